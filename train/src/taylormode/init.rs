//! A moving scene before the first step: first Gaussians, those that may move on the path of the body they are part of, and what the
//! configuration learns beside them.

use burn::tensor::Device;
use glam::{DVec3, Vec3};
use gs_datasets::Scene;
use gs_models::network::Mlp;
use gs_models::taylormode::order::has_pattern;
use gs_models::taylormode::{BlurWeights, DirectVelocity, PeanoMap, RemainderNetwork};

use crate::experiment::Config;
use crate::parameters::{Parameters, from_host};
use crate::scene_init::size_of;
use crate::step::Trainer;
use crate::taylormode::collective::Collective;
use crate::taylormode::config::{BlurMode, MaskSource, RemainderChoice, VelocitySource};
use crate::taylormode::first_paths::{contacts, first_paths, nearest, shape};
use crate::taylormode::first_points::first_points;
use crate::taylormode::hints::{Found, first_exposure, window};
use crate::taylormode::learned::Learned;
use crate::taylormode::state::{LearnedNetwork, MotionState, Network, RemainderFrame, still};
use crate::taylormode::tracks::Track;

/// The state before the first step, on what was `found` in the training views.
pub fn begin(scene: &Scene, found: &Found, config: &Config, device: &Device) -> Trainer {
    let (exposure, guess) = first_exposure(scene, config);
    let window = window(scene, exposure, &found.tracks);
    let extent = size_of(scene);

    let first = first_points(scene, found, config, window.t0);
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
    // Without masks there is no centre, no path of it and no body.
    if order > 0 && !found.tracks.is_empty() {
        state.contacts = hits;
        let (blocks, jumps) = first_paths(&found.tracks, &state, &first.gaussians.means, order);
        state.position = Learned::new(from_host(blocks, 3 * order, device));
        state.kinks = Learned::new(from_host(jumps, 3 * state.contacts.len(), device));
        if config.motion.collective {
            let frames = body_frames(&found.tracks, &state, &first.gaussians.means);
            state.bodies = frames.map(|(centre, size)| Collective::new(centre, size, order, device)).collect();
        }
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
/// to be seen and are no noise. Decided once, before training, from the triangulated centres of what moves: there the residual after
/// the best order is known without a scene.
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
    let places = places(state, means);
    let centre = middle(&places);
    RemainderFrame { centre: centre.to_array(), scale: spread(&places, centre), order }
}

/// Where places are measured from in each body and its root mean square size; bodies without Gaussians are left out. Of several,
/// that is the path's place at `t0`: a Gaussian then stays with the body on whose path it began.
fn body_frames(tracks: &[Track], state: &MotionState, means: &[[f32; 3]]) -> impl Iterator<Item = ([f64; 3], f64)> {
    let t0 = state.window.t0;
    let mut parts = vec![Vec::new(); tracks.len()];
    for place in places(state, means) {
        parts[nearest(tracks, t0, place)].push(place);
    }
    let filled = parts.into_iter().zip(tracks).filter(|(part, _)| !part.is_empty());
    let alone = tracks.len() == 1;
    filled.map(move |(part, track)| {
        let centre = if alone { middle(&part) } else { track.path.position(t0) };
        (centre.to_array(), spread(&part, centre))
    })
}

/// Where the moving Gaussians are at `t0`.
fn places(state: &MotionState, means: &[[f32; 3]]) -> Vec<DVec3> {
    state.rows.iter().map(|row| Vec3::from(means[*row as usize]).as_dvec3()).collect()
}

fn middle(places: &[DVec3]) -> DVec3 {
    places.iter().sum::<DVec3>() / places.len().max(1) as f64
}

fn spread(places: &[DVec3], centre: DVec3) -> f64 {
    let squares = places.iter().map(|place| place.distance_squared(centre)).sum::<f64>();
    let spread = (squares / places.len().max(1) as f64).sqrt();
    if spread > 0.0 { spread } else { 1.0 }
}
