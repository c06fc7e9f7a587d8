//! What a moving scene is measured by beside its sharp images: the blurry image it forms, its velocities, its exposure, and
//! what its motion costs.

use burn::tensor::Tensor;
use gs_burn::exposure::ExposureOptions;
use gs_burn::{Extras, Gaussians, RenderOptions, render_with};
use gs_datasets::{Scene, View};
use gs_models::taylormode::blur_path::{back_project, to_world};
use gs_models::taylormode::{FixedOrder, Pixels, Samples, Size, Summary, TaylorScene};
use gs_models::{Motion, sh_bands};
use serde::{Deserialize, Serialize};

use crate::data::{camera, to_tensor};
use crate::experiment::Config;
use crate::metrics::{median, psnr, psnr_masked};
use crate::parameters::to_host;
use crate::scene_init::size_of;
use crate::taylormode::blur::expose;
use crate::taylormode::config::{BlurMode, VelocitySource};
use crate::taylormode::hints::said_exposure;
use crate::taylormode::learns_exposure;
use crate::taylormode::state::{MotionState, Network};
use crate::taylormode::step::units;
use crate::taylormode::velocity::VelocityField;

/// Samples a measured blur is formed with, whatever the training used: enough that more change nothing visible up to about
/// sixty pixels of motion.
const MEASURE_SAMPLES: usize = 33;

/// Alpha under which a pixel shows too little to have a velocity.
const ALPHA_SEEN: f32 = 0.5;

/// Speeds under this share of the largest true speed have no direction worth measuring.
const SPEED_SHARE: f64 = 0.05;

/// Measures of a moving scene.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MotionScores {
    /// PSNR of the blurry image the scene forms, over held-out views whose blurry photo is known, dB.
    pub blurry_psnr: Option<f64>,
    /// Median angle between rendered and true velocity on moving surfaces, degrees.
    pub velocity_angle: Option<f64>,
    /// Median relative error of the speed there.
    pub velocity_magnitude: Option<f64>,
    /// The exposure, in the data set's unit of time.
    pub exposure: f64,
    /// Its relative error, where it was learned and the data set says the truth.
    pub exposure_error: Option<f64>,
    /// What the motion costs.
    pub cost: MotionCost,
}

/// What the scene costs, beside the same Gaussians with a fixed order everywhere.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct MotionCost {
    /// Gaussians that move.
    pub moving: usize,
    /// Share of Gaussians that do not, 0 to 1.
    pub static_share: f64,
    /// Mean order of the paths of those that move.
    pub mean_order: f64,
    /// Gaussians by order of their path, from 0 on.
    pub orders: Vec<usize>,
    /// Those that move, by order of their rotation, from 0 on.
    #[serde(default)]
    pub rotation_orders: Vec<usize>,
    /// Kinks in every path.
    #[serde(default)]
    pub kinks: usize,
    /// Whether paths have the 3D remainder of Eq. 2.
    #[serde(default)]
    pub remainder: bool,
    /// Numbers that describe motion: coefficients of paths and rotations up to each Gaussian's order, and the 3D remainder.
    pub motion_parameters: usize,
    /// The same with order `motion.order` and `motion.rotation_order` for every Gaussian.
    pub fixed_motion_parameters: usize,
    /// Gaussians by the degree of their view-dependent colour, from 0 on.
    #[serde(default)]
    pub sh_degrees: Vec<usize>,
    /// All numbers of the scene.
    pub parameters: usize,
    /// All numbers with fixed orders for every Gaussian.
    pub fixed_parameters: usize,
    /// Bytes of `parameters` as f32, with a row number per moving Gaussian.
    pub bytes: usize,
    /// Bytes of `fixed_parameters` as f32: all move, so none needs a row number.
    #[serde(default)]
    pub fixed_bytes: usize,
    /// The fixed order of paths, `motion.order`.
    #[serde(default)]
    pub fixed_order: usize,
}

/// Measures the scene on the held-out views.
pub fn measure(state: &MotionState, gaussians: &Gaussians, scene: &Scene, config: &Config) -> MotionScores {
    let model = state.scene(gaussians.clone());
    let views = if scene.test.is_empty() { &scene.train } else { &scene.test };
    let blurry: Vec<f64> = views.iter().filter_map(|view| blurry_psnr(&model, state, view, config)).collect();
    let (angles, magnitudes) = velocity_errors(&model, state, views, config, units(size_of(scene), state));
    let exposure = state.exposure();
    // The photos that were learned from; held-out views may have other exposures.
    let said = said_exposure(&scene.train).or_else(|| said_exposure(&scene.test));
    MotionScores {
        blurry_psnr: (!blurry.is_empty()).then(|| blurry.iter().sum::<f64>() / blurry.len() as f64),
        velocity_angle: median(angles),
        velocity_magnitude: median(magnitudes),
        exposure,
        exposure_error: said.filter(|_| learns_exposure(state, config)).map(|said| (exposure / said - 1.0).abs()),
        cost: cost(state, gaussians, config),
    }
}

/// The blurry image of a view as the scene forms it, `[H, W, 3]`.
pub fn form_blur(model: &TaylorScene, rows: &[u32], exposure: f64, view: &View, config: &Config) -> Tensor<3> {
    let device = model.gaussians.device();
    let render = config.render.options(model.gaussians.sh_degree(), config.data.background.color());
    let instants = Samples::Middles.instants(view.time.unwrap_or(0.0), exposure, MEASURE_SAMPLES);
    let options = ExposureOptions { render, linear: config.blur.linear };
    expose(model, rows, &instants, &camera(view, &device), &options, None).color.clamp(0.0, 1.0)
}

fn blurry_psnr(model: &TaylorScene, state: &MotionState, view: &View, config: &Config) -> Option<f64> {
    let blurry = view.truth.blurry.as_ref()?;
    let truth = to_tensor(view, &blurry.data, 3, &model.gaussians.device());
    let formed = form_blur(model, &state.rows, state.exposure(), view, config);
    Some(match &view.mask {
        None => psnr(formed, truth),
        Some(mask) => psnr_masked(formed, truth.clone(), to_tensor(view, mask, 1, &truth.device())),
    })
}

/// World velocities of what is seen, `[H * W * 3]`, and its alpha, `[H * W]`: those that the blur is formed with.
fn velocities(
    model: &TaylorScene,
    state: &MotionState,
    view: &View,
    config: &Config,
    units: (f64, f64),
) -> (Vec<f32>, Vec<f32>) {
    let t = view.time.unwrap_or(0.0);
    let scene = model.at(t);
    let camera = camera(view, &scene.device());
    let options = RenderOptions { depth: true, ..config.render.options(0, [0.0; 3]) };
    let extras = Extras { features: Some(model.velocity(t)), screen: None };
    let rendering = render_with(&scene, &camera, &options, extras);
    let pixels = Pixels::all(view.width, view.height, &scene.device());
    let alpha = pixels.of(rendering.alpha.clone());
    let splatted = pixels.of(rendering.features.clone().expect("features were given"));
    let seen = alpha.clone().clamp_min(f32::MIN_POSITIVE);
    let found = if config.blur.mode == BlurMode::Warp {
        let network = |kind| state.network(kind);
        let field = VelocityField { blur: &config.blur, units, network: &network };
        let depth = || pixels.of(rendering.expected_depth().expect("depth was asked for"));
        let places = || to_world(back_project(&pixels, depth(), &camera.intrinsics), &camera.viewmat);
        let found = field.at(state.window.normalised(t), || splatted, places);
        if config.blur.velocity == VelocitySource::Taylor { found / seen } else { found }
    } else {
        splatted / seen
    };
    (to_host(found), to_host(alpha))
}

/// Angles in degrees and relative errors of the speed, over the pixels of moving surfaces.
fn velocity_errors(
    model: &TaylorScene,
    state: &MotionState,
    views: &[View],
    config: &Config,
    units: (f64, f64),
) -> (Vec<f64>, Vec<f64>) {
    let (mut angles, mut magnitudes) = (Vec::new(), Vec::new());
    for view in views {
        let (Some(truth), Some(moving)) = (&view.truth.velocity, &view.truth.moving) else { continue };
        let (found, alpha) = velocities(model, state, view, config, units);
        let truth = truth.as_chunks::<3>().0;
        let fastest = truth.iter().map(|v| length(*v)).fold(0.0, f64::max);
        for (pixel, true_velocity) in truth.iter().enumerate() {
            let speed = length(*true_velocity);
            if moving[pixel] == 0 || alpha[pixel] < ALPHA_SEEN || speed <= SPEED_SHARE * fastest {
                continue;
            }
            let seen = found.as_chunks::<3>().0[pixel];
            let dot: f64 = (0..3).map(|c| f64::from(seen[c]) * f64::from(true_velocity[c])).sum();
            let cosine = dot / (speed * length(seen)).max(f64::MIN_POSITIVE);
            angles.push(cosine.clamp(-1.0, 1.0).acos().to_degrees());
            magnitudes.push((length(seen) / speed - 1.0).abs());
        }
    }
    (angles, magnitudes)
}

/// Gaussians by the degree that their colour uses.
fn sh_degrees(gaussians: &Gaussians) -> Vec<usize> {
    let mut degrees = vec![0; gaussians.sh_degree() + 1];
    let sh = to_host(gaussians.sh.val().flatten::<2>(1, 2));
    sh.chunks_exact(3 * gaussians.sh.dims()[1]).for_each(|sh| degrees[sh_bands::degree(sh)] += 1);
    degrees
}

/// What a scene costs.
fn cost(state: &MotionState, gaussians: &Gaussians, config: &Config) -> MotionCost {
    let usize_of = |orders: &[u8]| -> Vec<usize> { orders.iter().map(|order| usize::from(*order)).collect() };
    // Rendering needs the 3D remainder; the other networks only form blur in training.
    let remainder = state.networks.iter().filter(|network| network.kind == Network::Remainder);
    let network =
        remainder.flat_map(|network| &network.tensors).map(|tensor| tensor.value.dims().iter().product::<usize>());
    let degrees = sh_degrees(gaussians);
    let size = Size {
        gaussians: gaussians.len(),
        sh_coefficients: degrees.iter().enumerate().map(|(degree, count)| count * (degree + 1).pow(2)).sum(),
        position_orders: usize_of(&state.orders),
        rotation_orders: usize_of(&state.rotation_orders),
        // Times of the contacts, and a jump for each moving Gaussian at each.
        network: network.sum::<usize>() + state.contacts.len() * (2 + 3 * state.rows.len()),
    };
    let fixed = FixedOrder {
        gaussians: size.gaussians,
        sh_coefficients: gaussians.sh.dims()[1],
        position: config.motion.order,
        rotation: config.motion.rotation_order,
    };
    let blocks: usize = size.position_orders.iter().chain(&size.rotation_orders).sum();
    let summary = Summary::new(&size, &fixed);
    MotionCost {
        moving: state.rows.len(),
        static_share: summary.static_share,
        mean_order: size.position_orders.iter().sum::<usize>() as f64 / state.rows.len().max(1) as f64,
        orders: summary.histogram,
        rotation_orders: histogram(&size.rotation_orders),
        kinks: state.contacts.len(),
        remainder: state.remainder.is_some(),
        motion_parameters: 3 * blocks + size.network,
        fixed_motion_parameters: 3 * size.gaussians * (fixed.position + fixed.rotation),
        sh_degrees: degrees,
        parameters: summary.parameters,
        fixed_parameters: summary.fixed_order_parameters,
        bytes: summary.bytes,
        fixed_bytes: 4 * summary.fixed_order_parameters,
        fixed_order: fixed.position,
    }
}

impl MotionScores {
    /// The figures in one line.
    pub fn line(&self) -> String {
        let optional = |text: &str, value: Option<f64>, unit: &str| {
            value.map_or(String::new(), |value| format!("{text} {value:.2}{unit}, "))
        };
        let saved = 100.0 * self.cost.saved();
        format!(
            "motion: {}{}{}exposure {:.4}{}; {} moving ({:.0} % static), mean order {:.2}{}{}, {} numbers of motion ({saved:.0} % fewer than fixed order), Gaussians by SH degree {:?}",
            optional("blurry PSNR", self.blurry_psnr, " dB"),
            optional("velocity off by", self.velocity_angle, " degrees"),
            optional("speed off by", self.velocity_magnitude.map(|x| 100.0 * x), " %"),
            self.exposure,
            self.exposure_error.map_or(String::new(), |error| format!(" (off by {:.1} %)", 100.0 * error)),
            self.cost.moving,
            100.0 * self.cost.static_share,
            self.cost.mean_order,
            if self.cost.kinks > 0 { format!(", kinks {}", self.cost.kinks) } else { String::new() },
            if self.cost.remainder { ", a remainder" } else { "" },
            self.cost.motion_parameters,
            self.cost.sh_degrees,
        )
    }
}

impl MotionCost {
    /// Share of the fixed orders' numbers of motion that this scene does without.
    pub fn saved(&self) -> f64 {
        1.0 - self.motion_parameters as f64 / self.fixed_motion_parameters.max(1) as f64
    }
}

fn histogram(orders: &[usize]) -> Vec<usize> {
    let mut counts = vec![0; orders.iter().max().map_or(0, |highest| highest + 1)];
    orders.iter().for_each(|order| counts[*order] += 1);
    counts
}

fn length(v: [f32; 3]) -> f64 {
    v.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt()
}
