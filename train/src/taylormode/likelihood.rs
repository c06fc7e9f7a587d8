//! Whether a simpler motion explains the photos as well: the likelihood check on what [`select`](super::select) proposes.

use burn::tensor::Tensor;
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
    let before = judges.iter().map(|view| squares(parameters, state, view, config)).sum::<f64>();
    let pixels: f64 = judges.iter().map(|view| (3 * view.width * view.height) as f64).sum();
    let area = blur_area(parameters, state, views);
    for share in SHARES {
        let (mut lowered, mut simpler) = (parameters.clone(), state.clone());
        let mut motion = config.motion.clone();
        motion.select_pixels *= share;
        let selected = select(&mut lowered, &mut simpler, views, &motion);
        let dropped = blocks(state) - blocks(&simpler);
        let after = judges.iter().map(|view| squares(&lowered, &simpler, view, config)).sum::<f64>();
        let evidence = Evidence {
            lower: after,
            higher: before,
            variance: (before / pixels).max(f64::MIN_POSITIVE),
            pixels,
            blur_area: area,
            parameters: 3.0 * dropped as f64,
        };
        if !evidence.accepts() {
            (*parameters, *state) = (lowered, simpler);
            return selected;
        }
        tracing::debug!(share, before, after, dropped, "the photos want the motion kept");
    }
    Selected::default()
}

/// Coefficient blocks and jumps in use.
fn blocks(state: &MotionState) -> usize {
    let blocks: usize = state.orders.iter().chain(&state.rotation_orders).map(|order| usize::from(*order)).sum();
    blocks + state.contacts.len() * state.rows.len()
}

/// Sum of squared differences of a photo from what the scene makes of it.
fn squares(parameters: &Parameters, state: &MotionState, view: &View, config: &Config) -> f64 {
    let scene = state.scene(parameters.gaussians());
    let device = parameters.device();
    let render = config.render.options(parameters.sh_degree(), config.data.background.color());
    let blurs = config.blur.mode != BlurMode::None;
    let count = if blurs { config.blur.samples } else { 1 };
    let instants = Samples::Middles.instants(view.time.unwrap_or(0.0), state.exposure(), count);
    let options = ExposureOptions { render, linear: config.blur.linear };
    let formed = expose(&scene, &state.rows, &instants, &camera(view, &device), &options, None);
    let photo = to_tensor(view, &view.image.data, 3, &device);
    let misses = (formed.color - photo).square();
    let sum: Tensor<1> = match &view.mask {
        None => misses.sum(),
        Some(mask) => (misses * to_tensor(view, mask, 1, &device)).sum(),
    };
    f64::from(sum.into_scalar::<f32>())
}

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
