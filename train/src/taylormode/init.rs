//! The first Gaussians of a moving scene: static ones from the points or backgrounds, moving ones from the visual hull of
//! what moves at the middle of the recording, on the path of its centre.

use burn::tensor::Device;
use gs_datasets::motion::{self, HullOptions};
use gs_datasets::{PointCloud, Scene, View};
use gs_models::network::Mlp;
use gs_models::taylormode::order::has_pattern;
use gs_models::taylormode::{BlurWeights, DirectVelocity, PeanoMap, RemainderNetwork};
use rayon::prelude::*;

use crate::experiment::Config;
use crate::parameters::{Parameters, from_host};
use crate::scene_init::{FirstGaussians, gaussians_at, points_in_front, size_of};
use crate::step::Trainer;
use crate::taylormode::collective::Collective;
use crate::taylormode::config::{BlurMode, MaskSource, RemainderChoice, VelocitySource};
use crate::taylormode::first_paths::{contacts, first_paths, shape};
use crate::taylormode::hints::{Found, Track, first_exposure, window};
use crate::taylormode::learned::Learned;
use crate::taylormode::state::{LearnedNetwork, MotionState, Network, RemainderFrame, still};

/// Most of the cap that Gaussians which may move take to begin with.
const MOVING_SHARE: f64 = 0.5;

/// The state before the first step, on what was `found` in the training views.
pub fn begin(scene: &Scene, found: &Found, config: &Config, device: &Device) -> Trainer {
    let (exposure, guess) = first_exposure(scene, config);
    let window = window(scene, exposure, &found.tracks);
    let extent = size_of(scene);

    let (still_points, moving_points) = first_points(scene, found, config, window.t0);
    // What moves comes first: points without number for what stands still would leave no room for it under the cap.
    let cap = config.density.cap;
    let share = config.motion.points.min((MOVING_SHARE * cap as f64) as usize).max(1);
    let moving = gaussians_of(scene, &moving_points, config, share);
    let room = cap.saturating_sub(moving.means.len());
    let still_points = still_points.unwrap_or_else(|| invented_points(scene, found, config, room));
    let fixed = gaussians_of(scene, &still_points, config, room);
    let first = joined(fixed, moving);

    let count = first.gaussians.means.len();
    let nothing_found = first.fixed == count;
    let rows: Vec<u32> = match config.motion.masks {
        _ if nothing_found => (0..count as u32).collect(),
        MaskSource::None => (0..count as u32).collect(),
        _ => (first.fixed as u32..count as u32).collect(),
    };
    if nothing_found && config.motion.masks != MaskSource::None {
        tracing::warn!(
            "no place was found where something moves: every Gaussian may move, and selection stops the others"
        );
    }
    let hits = contacts(&found.tracks, &window, config.motion.kinks);
    let (order, hits) = shape(&found.tracks, window, hits, found.pixels_per_unit, config.motion.order);
    let mut state = still(rows, window, [order, config.motion.rotation_order], exposure, device);
    state.exposure_said = config.blur.exposure == 0.0 && guess.is_none();
    // Without masks there is no centre, and no path of it.
    if order > 0 && !found.tracks.is_empty() {
        state.contacts = hits;
        let (blocks, jumps) = first_paths(&found.tracks, &state, &first.gaussians.means, order);
        state.position = Learned::new(from_host(blocks, 3 * order, device));
        state.kinks = Learned::new(from_host(jumps, 3 * state.contacts.len(), device));
    }
    // Bodies that move apart have no common motion.
    if config.motion.collective && order > 0 && found.tracks.len() == 1 {
        let RemainderFrame { centre, scale, .. } = remainder_frame(&state, &first.gaussians.means, order);
        state.collective = Some(Collective::new(centre, scale, order, device));
    }
    if let Some((first, last)) = scene.time_range {
        state.recording = [first, last];
    }
    (state.networks, state.remainder) = networks(&state, found, &first.gaussians.means, config, device);
    let parameters = Parameters::first(&first.gaussians, device);
    Trainer::from_parts(parameters, Some(state), extent, config)
}

/// The networks that the configuration asks for.
fn networks(
    state: &MotionState,
    found: &Found,
    means: &[[f32; 3]],
    config: &Config,
    device: &Device,
) -> (Vec<LearnedNetwork>, Option<RemainderFrame>) {
    let mut networks = Vec::new();
    let blur = &config.blur;
    let mut frame = None;
    if wants_remainder(found, config) {
        let around = remainder_frame(state, means, state.order());
        let network = RemainderNetwork::new(around.order, around.centre, around.scale, config.seed, device);
        networks.push(LearnedNetwork::new(Network::Remainder, &network.mlp));
        frame = Some(around);
    }
    if blur.mode == BlurMode::Warp {
        // Their units are those of every step (`units`), so only the matrices are kept.
        let mut add = |kind, mlp: Mlp| networks.push(LearnedNetwork::new(kind, &mlp));
        if blur.velocity == VelocitySource::Network {
            add(Network::Velocity, DirectVelocity::new([0.0; 3], 1.0, 1.0, config.seed, device).mlp);
        } else if blur.peano {
            add(Network::Peano, PeanoMap::new(1.0, config.seed, device).mlp);
        }
        if blur.weights {
            add(Network::Weights, BlurWeights::new(blur.samples, 1.0, 1.0, config.seed, device).mlp);
        }
    }
    (networks, frame)
}

/// Root mean square distance of the centres from their best polynomial, pixels, under which a remainder has nothing to add
/// that a photo shows.
const REMAINDER_PIXELS: f64 = 0.5;

/// Standard deviations of the centre's own uncertainty that its distance from the best polynomial must exceed. What is left
/// of a high order alternates from frame to frame, which a correlation in time alone would take for noise.
const REMAINDER_DEVIATIONS: f64 = 3.0;

/// Whether the 3D remainder is worth having: asked for, or the centre's distances from the best polynomial are large enough
/// to be seen and are no noise.
pub fn wants_remainder(found: &Found, config: &Config) -> bool {
    match config.motion.remainder {
        RemainderChoice::On => true,
        RemainderChoice::Off => false,
        RemainderChoice::Auto => found.tracks.iter().any(|track| leaves_a_pattern(track, found.pixels_per_unit)),
    }
}

fn leaves_a_pattern(track: &Track, pixels_per_unit: f64) -> bool {
    let residuals: Vec<[f64; 3]> =
        track.centres.iter().map(|centre| (centre.position - track.path.position(centre.t)).to_array()).collect();
    let count = residuals.len().max(1) as f64;
    let rms = (residuals.iter().flatten().map(|x| x * x).sum::<f64>() / count).sqrt() * pixels_per_unit;
    // A centroid seen by n cameras is known sqrt(n) times better than by one.
    let noise = track.centres.iter().map(|c| c.residual_px.powi(2) / c.cameras as f64).sum::<f64>() / count;
    let beyond_noise = rms > REMAINDER_DEVIATIONS * noise.sqrt();
    rms > REMAINDER_PIXELS && (beyond_noise || has_pattern(&residuals))
}

/// Centre and root mean square size of what moves.
pub fn remainder_frame(state: &MotionState, means: &[[f32; 3]], order: usize) -> RemainderFrame {
    let places: Vec<glam::DVec3> =
        state.rows.iter().map(|row| glam::Vec3::from(means[*row as usize]).as_dvec3()).collect();
    let count = places.len().max(1) as f64;
    let centre = places.iter().sum::<glam::DVec3>() / count;
    let spread = (places.iter().map(|place| place.distance_squared(centre)).sum::<f64>() / count).sqrt();
    RemainderFrame { centre: centre.to_array(), scale: if spread > 0.0 { spread } else { 1.0 }, order }
}

/// Static points (`None`: random ones) and moving points.
fn first_points(scene: &Scene, found: &Found, config: &Config, t0: f64) -> (Option<PointCloud>, PointCloud) {
    let options = HullOptions { points: config.motion.points, ..HullOptions::default() };
    let hull = motion::hull(scene, &found.masks.masks, t0, &options);
    for note in &hull.notes {
        tracing::info!("{note}");
    }
    let mut moving = hull.points;
    let Some(points) = scene.points.as_ref().filter(|points| !points.is_empty()) else {
        return (None, moving);
    };
    let mut fixed = PointCloud::default();
    for (position, color) in points.positions.iter().zip(&points.colors) {
        let to = if moves_at(scene, found, t0, *position) { &mut moving } else { &mut fixed };
        to.positions.push(*position);
        to.colors.push(*color);
    }
    (Some(fixed), moving)
}

/// Share of the views of one time that must have a point in their mask before it counts as moving.
const MOVING_VIEWS: f64 = 0.8;

/// Whether a point lies in the masks of nearly all views of a time that see it.
fn moves_at(scene: &Scene, found: &Found, t0: f64, point: [f32; 3]) -> bool {
    let (mut seen, mut inside) = (0, 0);
    for (view, mask) in scene.train.iter().zip(&found.masks.masks) {
        let (Some(mask), true) = (mask, view.time == Some(t0)) else { continue };
        let place = view.c2w.inverse().transform_point3(glam::Vec3::from(point).as_dvec3());
        if let Some(pixel) = pixel_of(view, place) {
            seen += 1;
            inside += usize::from(mask[pixel] > 0);
        }
    }
    seen > 0 && inside as f64 >= MOVING_VIEWS * f64::from(seen)
}

/// Points for what stands still where the data set has none: in front of the cameras, with the colours of what stands still
/// there, and none before what is seen moving.
fn invented_points(scene: &Scene, found: &Found, config: &Config, room: usize) -> PointCloud {
    let count = config.init.random_points.min(room);
    let mut points = points_in_front(&backgrounds(scene), count, size_of(scene), config.seed);
    let clear: Vec<bool> = points.positions.par_iter().map(|point| !hides(scene, found, *point)).collect();
    let mut kept = clear.iter();
    points.positions.retain(|_| *kept.next().expect("one for each"));
    let mut kept = clear.iter();
    points.colors.retain(|_| *kept.next().expect("one for each"));
    tracing::info!(of = count, hiding = clear.len() - points.len(), "points before what moves were left out");
    points
}

/// Views that must see something move behind a point: one mask may be wrong there.
const HIDES: usize = 2;

/// Whether a point would hide what is seen to move: it lies in masks of moving pixels, nearer than the centre of what moves.
fn hides(scene: &Scene, found: &Found, point: [f32; 3]) -> bool {
    let point = glam::Vec3::from(point).as_dvec3();
    let seen_behind = |(view, mask): &(&View, &Option<Vec<u8>>)| {
        let (Some(mask), Some(t)) = (mask, view.time) else { return false };
        let to_camera = view.c2w.inverse();
        let place = to_camera.transform_point3(point);
        let depths = found.tracks.iter().map(|track| to_camera.transform_point3(track.path.position(t)).z);
        // Of several bodies the nearest: whichever it is that moves there, the point is before it.
        let is_nearer = place.z < depths.fold(f64::INFINITY, f64::min);
        !found.tracks.is_empty() && is_nearer && pixel_of(view, place).is_some_and(|pixel| mask[pixel] > 0)
    };
    scene.train.iter().zip(&found.masks.masks).filter(seen_behind).take(HIDES).count() == HIDES
}

/// The pixel of a view that shows a place in its camera's axes.
fn pixel_of(view: &View, place: glam::DVec3) -> Option<usize> {
    let k = &view.intrinsics;
    let (x, y) = (k.fx * place.x / place.z + k.cx, k.fy * place.y / place.z + k.cy);
    let inside = place.z > 0.0 && x >= 0.0 && y >= 0.0 && x < view.width as f64 && y < view.height as f64;
    inside.then(|| y as usize * view.width + x as usize)
}

/// Gaussians at points.
fn gaussians_of(scene: &Scene, points: &PointCloud, config: &Config, cap: usize) -> FirstGaussians {
    if points.is_empty() {
        return FirstGaussians::default();
    }
    gaussians_at(Some(points), &[], size_of(scene), &config.init, cap, config.seed)
}

/// One view for each camera that stands still, showing what stands still in front of it; all views where none does.
fn backgrounds(scene: &Scene) -> Vec<View> {
    let views: Vec<View> = motion::static_cameras(&scene.train)
        .iter()
        .filter_map(|camera| {
            let background = motion::background(&scene.train, camera)?;
            Some(View { image: background.image, ..scene.train[*camera.views.first()?].clone() })
        })
        .collect();
    if views.is_empty() { scene.train.clone() } else { views }
}

struct First {
    gaussians: FirstGaussians,
    /// How many of them, the first ones, stand still.
    fixed: usize,
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
    First { gaussians, fixed: count }
}
