//! Whether a simpler motion explains the photos as well: the likelihood check on what [`select`](super::select) proposes.
//!
//! One verdict is given on all Gaussians together, and the residual variance is that of training photos: a Gaussian alone changes too
//! few pixels to be judged, and no photo is set aside. So the check vetoes what shows, while the tenth of a pixel that a proposal may
//! move anything is what decides for single Gaussians.

use burn::tensor::{Device, Tensor};
use gs_burn::exposure::ExposureOptions;
use gs_datasets::View;
use gs_models::taylormode::shrinkage::pixels_per_unit;
use gs_models::taylormode::{Evidence, Samples};

use crate::data::{camera, to_tensor};
use crate::experiment::Config;
use crate::parameters::{Parameters, to_host};
use crate::taylormode::blur::expose;
use crate::taylormode::config::BlurMode;
use crate::taylormode::select::{Selected, select, sights};
use crate::taylormode::state::MotionState;

/// Photos a proposal is judged by, spread evenly over the training views: enough that one of them cannot decide.
const PHOTOS: usize = 6;

/// Shares of the threshold in pixels that are tried, one after another, until the photos agree.
const SHARES: [f64; 3] = [1.0, 0.5, 0.25];

/// Selects, and takes the selection back where the photos say that the motion it dropped was worth its numbers (Schwarz's
/// criterion, with pixels that share a blur counted as one).
pub fn select_with_check(
    parameters: &mut Parameters,
    state: &mut MotionState,
    views: &[View],
    config: &Config,
) -> Selected {
    if state.rows.is_empty() || views.is_empty() {
        return Selected::default();
    }
    let judges: Vec<&View> = views.iter().step_by(views.len().div_ceil(PHOTOS)).collect();
    let before: Vec<Tensor<3>> = judges.iter().map(|view| formed(parameters, state, view, config)).collect();
    let area = blur_area(parameters, state, views);
    for share in SHARES {
        let (mut lowered, mut simpler) = (parameters.clone(), state.clone());
        let mut motion = config.motion.clone();
        motion.select_pixels *= share;
        let selected = select(&mut lowered, &mut simpler, views, &motion);
        let dropped = blocks(state) - blocks(&simpler);
        let one = |(view, before): (&&View, &Tensor<3>)| {
            compared(view, formed(&lowered, &simpler, view, config), before.clone(), &parameters.device())
        };
        let [lower, higher, pixels] = judges.iter().zip(&before).map(one).fold([0.0; 3], add);
        let evidence = Evidence {
            lower,
            higher,
            variance: (higher / pixels).max(f64::MIN_POSITIVE),
            pixels,
            blur_area: area,
            parameters: 3.0 * dropped as f64,
        };
        if !evidence.accepts() {
            (*parameters, *state) = (lowered, simpler);
            return selected;
        }
        tracing::debug!(share, lower, higher, pixels, dropped, "the photos want the motion kept");
    }
    Selected::default()
}

/// Coefficient blocks and jumps in use.
fn blocks(state: &MotionState) -> usize {
    let blocks: usize = state.orders.iter().chain(&state.rotation_orders).map(|order| usize::from(*order)).sum();
    blocks + state.contacts.len() * state.rows.len()
}

/// The photo that the scene makes.
fn formed(parameters: &Parameters, state: &MotionState, view: &View, config: &Config) -> Tensor<3> {
    let scene = state.scene(parameters.gaussians());
    let device = parameters.device();
    let render = config.render.options(parameters.sh_degree(), config.data.background.color());
    let blurs = config.blur.mode != BlurMode::None;
    let count = if blurs { config.blur.samples } else { 1 };
    let instants = Samples::Middles.instants(view.time.unwrap_or(0.0), state.exposure(), count);
    let options = ExposureOptions { render, linear: config.blur.linear };
    expose(&scene, &state.rows, &instants, &camera(view, &device), &options, None).color
}

/// Sums of squared differences from the photo with the simpler and with the present motion, and how many differences these are:
/// of the pixels that the two draw differently. The others say nothing about either, and are explained better than what moves.
fn compared(view: &View, simpler: Tensor<3>, present: Tensor<3>, device: &Device) -> [f64; 3] {
    let differs = (simpler.clone() - present.clone()).abs().max_dim(2).greater_elem(NOTICED).float();
    let counts = match &view.mask {
        None => differs,
        Some(mask) => differs * to_tensor(view, mask, 1, device),
    };
    let photo = to_tensor(view, &view.image.data, 3, device);
    let sum = |tensor: Tensor<3>| f64::from(tensor.sum().into_scalar::<f32>());
    let misses = |image: Tensor<3>| sum((image - photo.clone()).square() * counts.clone());
    [misses(simpler), misses(present), 3.0 * sum(counts.clone())]
}

fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| a[i] + b[i])
}

/// Colour (0 to 1) by which two images differ: half a step of an 8-bit photo.
const NOTICED: f64 = 0.5 / 255.0;

/// Mean path of the moving Gaussians during one exposure, pixels: the length over which a blur ties pixels together.
fn blur_area(parameters: &Parameters, state: &MotionState, views: &[View]) -> f64 {
    let gaussians = parameters.gaussians();
    let speeds = to_host(state.motion(&gaussians).velocity(state.window.t0));
    let means = to_host(gaussians.means.val());
    let scales = pixels_per_unit(&means, &state.rows, &sights(views));
    let exposure = state.exposure();
    let lengths = speeds
        .as_chunks::<3>()
        .0
        .iter()
        .zip(&scales)
        .filter(|(_, scale)| scale.is_finite())
        .map(|(v, scale)| v.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt() * exposure * scale);
    let lengths: Vec<f64> = lengths.collect();
    (lengths.iter().sum::<f64>() / lengths.len().max(1) as f64).max(1.0)
}
