//! The first Gaussians of a moving scene: static ones from the points or backgrounds, moving ones from the visual hull of
//! what moves at the middle of the recording, on the path of its centre.

use burn::tensor::Device;
use gs_datasets::motion::{self, HullOptions, Trajectory};
use gs_datasets::{PointCloud, Scene, View};
use gs_models::taylormode::TimeWindow;

use crate::experiment::Config;
use crate::parameters::{Parameters, from_host};
use crate::scene_init::{FirstGaussians, first_gaussians, size_of};
use crate::step::Trainer;
use crate::taylormode::config::{BlurMode, MaskSource, RemainderChoice, VelocitySource};
use crate::taylormode::hints::{Found, first_exposure, gather, window};
use crate::taylormode::learned::Learned;
use crate::taylormode::state::{LearnedNetwork, MotionState, Network, still};

/// The state before the first step.
pub fn begin(scene: &Scene, config: &Config, device: &Device) -> Trainer {
    let found = gather(scene, config);
    let (exposure, _) = first_exposure(scene, config);
    let window = window(scene, exposure);
    let extent = size_of(scene);

    let (still_points, moving_points) = first_points(scene, &found, config, window.t0);
    let fixed = gaussians_of(scene, still_points, config, config.density.cap);
    let room = config.density.cap.saturating_sub(fixed.means.len()).max(1);
    let moving = gaussians_of(scene, Some(moving_points), config, room.min(config.motion.points));
    let first = joined(fixed, moving);

    let count = first.means.len();
    let rows: Vec<u32> = match config.motion.masks {
        MaskSource::None => (0..count as u32).collect(),
        _ => (first.fixed as u32..count as u32).collect(),
    };
    let orders = [config.motion.order, config.motion.rotation_order];
    let mut state = still(rows, window, orders, exposure, device);
    if config.motion.masks != MaskSource::None {
        follow_centre(&mut state, &found, config.motion.order, window, device);
    }
    state.networks = networks(config, device);
    let parameters = Parameters::first(&first.gaussians, device);
    Trainer::from_parts(parameters, Some(state), extent, config)
}

/// The networks that the configuration asks for.
fn networks(config: &Config, device: &Device) -> Vec<LearnedNetwork> {
    use gs_models::taylormode::{Remainder, warp};
    let mut networks = Vec::new();
    let blur = &config.blur;
    if config.motion.remainder == RemainderChoice::On {
        let mlp = Remainder::first(config.seed, device).into_mlp();
        networks.push(LearnedNetwork::new(Network::Remainder, &mlp));
    }
    if blur.mode == BlurMode::Warp {
        if blur.velocity == VelocitySource::Network {
            networks.push(LearnedNetwork::new(Network::Velocity, &warp::first_direct(config.seed, device)));
        } else if blur.peano {
            networks.push(LearnedNetwork::new(Network::Peano, &warp::first_peano(config.seed, device)));
        }
        if blur.weights {
            networks.push(LearnedNetwork::new(Network::Weights, &warp::first_weights(config.seed, blur.samples, device)));
        }
    }
    networks
}

/// Static points (`None`: random ones) and moving points.
fn first_points(scene: &Scene, found: &Found, config: &Config, t0: f64) -> (Option<PointCloud>, PointCloud) {
    let options = HullOptions { points: config.motion.points, ..HullOptions::default() };
    let mut moving = motion::hull(scene, &found.masks, t0, &options);
    let Some(points) = scene.points.as_ref().filter(|points| !points.is_empty()) else {
        return (None, moving);
    };
    let moves = motion::points_that_move(scene, &found.masks, t0, points);
    let mut fixed = PointCloud::default();
    for (index, moves) in moves.iter().enumerate() {
        let to = if *moves { &mut moving } else { &mut fixed };
        to.positions.push(points.positions[index]);
        to.colors.push(points.colors[index]);
    }
    (Some(fixed), moving)
}

/// Gaussians at points, or random in front of the cameras, coloured by what stands still there.
fn gaussians_of(scene: &Scene, points: Option<PointCloud>, config: &Config, cap: usize) -> FirstGaussians {
    if points.as_ref().is_some_and(PointCloud::is_empty) {
        return FirstGaussians { opacity_logit: 0.0, ..FirstGaussians::default() };
    }
    let train = if points.is_some() { scene.train.clone() } else { backgrounds(scene) };
    let scene = Scene { train, test: Vec::new(), points, warnings: Vec::new(), ..scene.clone() };
    first_gaussians(&scene, &config.init, cap, config.seed)
}

/// One view per camera that stands still, showing what stands still in front of it.
fn backgrounds(scene: &Scene) -> Vec<View> {
    motion::static_backgrounds(&scene.train)
}

struct First {
    gaussians: FirstGaussians,
    fixed: usize,
    means: Vec<[f32; 3]>,
}

fn joined(fixed: FirstGaussians, moving: FirstGaussians) -> First {
    let count = fixed.means.len();
    let opacity_logit = if count > 0 { fixed.opacity_logit } else { moving.opacity_logit };
    let gaussians = FirstGaussians {
        means: [fixed.means, moving.means].concat(),
        log_scales: [fixed.log_scales, moving.log_scales].concat(),
        sh_dc: [fixed.sh_dc, moving.sh_dc].concat(),
        opacity_logit,
    };
    First { means: gaussians.means.clone(), gaussians, fixed: count }
}

/// Sends every moving Gaussian along the path of the centre, a polynomial of at most the configured order.
fn follow_centre(state: &mut MotionState, found: &Found, order: usize, window: TimeWindow, device: &Device) {
    let Some(path) = Trajectory::fit(&found.centres, order) else { return };
    let blocks = path.displacement_blocks(window.t0, window.half, order);
    let row: Vec<f32> = blocks.iter().flat_map(|block| block.as_vec3().to_array()).collect();
    if row.len() == 3 * order && order > 0 {
        state.position = Learned::new(from_host(row.repeat(state.rows.len()), 3 * order, device));
    }
}
