//! The state of a moving scene before the first step: initial Gaussians, the initial paths of moving ones, which are
//! those of their objects, and the networks that the configuration learns beside them.

use std::collections::BTreeSet;

use burn::module::Param;
use burn::tensor::{Device, Tensor};
use glam::{DVec3, Vec3};
use gs_base::mean;
use gs_datasets::Scene;
use gs_models::taylormode::bodies::NO_BODY;
use gs_models::taylormode::order::has_pattern;
use gs_models::taylormode::{BodyFrame, MotionFrame, RemainderFrame};
use gs_multiview::Track;

use super::bodies::bodies;
use super::config::{BlurMode, MaskSource, RemainderChoice, VelocitySource};
use super::cues::{Cues, first_exposure, window};
use super::initial_paths::{contacts, initial_paths, nearest, shape};
use super::initial_points::initial_points;
use super::model::{Networks, Units};
use super::score::Score;
use super::{Config, Step, Taylormode};
use gs_train::fit::initialise::InitialGaussians;
use gs_train::fit::parameters::from_host;

/// The state before the first step.
pub fn begin(scene: &Scene, at: &Step, device: &Device) -> (InitialGaussians, Taylormode) {
    let (cues, config, choice) = (at.cues, at.config, &at.config.method);
    let (exposure, guess) = first_exposure(scene, config);
    let window = window(scene, exposure, &cues.tracks);

    let initial = initial_points(scene, cues, config, at.facts.extent, window.t0);
    let count = initial.gaussians.means.len();
    let nothing_found = initial.fixed == count;
    let rows: Vec<u32> = match choice.motion.masks {
        _ if nothing_found => (0..count as u32).collect(),
        MaskSource::None => (0..count as u32).collect(),
        _ => (initial.fixed as u32..count as u32).collect(),
    };
    if nothing_found && choice.motion.masks != MaskSource::None {
        tracing::warn!(
            "no position was found where something moves: every Gaussian may move, and selection stops the others"
        );
    }
    let kinked = contacts(&cues.tracks, &window, choice.motion.kinks);
    let (order, kinked) =
        shape(&cues.tracks, window, kinked, (cues.scale.widths_per_unit, choice.cues.unseen), choice.motion.order);
    let highest = order.max(choice.motion.order_max);
    let mut frame = MotionFrame::new(rows, highest, choice.motion.rotation_order, window);
    frame.orders.fill(order as u8);
    if let Some((first, last)) = scene.time_range {
        frame.recording = [first, last];
    }
    // Without masks there are no centres, paths or objects.
    let follows = order > 0 && !cues.tracks.is_empty();
    if follows {
        frame.contacts = kinked;
    }
    let means = &initial.gaussians.means;
    if wants_remainder(cues, config) {
        frame.remainder = Some(remainder_frame(&frame.rows, means, order));
    }
    if highest > 0 && choice.motion.collective {
        (frame.bodies, frame.body_of) = match (follows, nothing_found) {
            (true, _) => objects(&cues.tracks, &frame, means),
            (false, true) => (Vec::new(), frame.body_of),
            (false, false) => apart(&frame, means),
        };
        frame.bodies.iter_mut().for_each(|body| body.order = order as u8);
    }
    for row in (0..frame.rows.len()).filter(|row| frame.body_of[*row] != NO_BODY).collect::<Vec<_>>() {
        (frame.orders[row], frame.rotation_orders[row], frame.own_jumps[row]) = (0, 0, false);
    }
    let units = Units::new(at.facts.extent, window.half);
    let mut model = Taylormode::new(&frame, exposure, (networks(config), units), config.seed, device);
    model.stated_exposure = (choice.blur.exposure == 0.0 && guess.is_none()).then_some(exposure);
    if model.stated_exposure.is_none() && model.learns_exposure(config) {
        let names: Option<BTreeSet<String>> = scene.train.iter().map(|view| view.camera_id.clone()).collect();
        model = model.with_cameras(names.unwrap_or_default().into_iter().collect());
    }
    model.score = (!model.motion.bodies.is_empty()).then(|| Score::new(&model.motion, device));
    if follows {
        let (blocks, jumps) = initial_paths(&cues.tracks, &frame, means, order);
        let width = [3 * order, 3 * frame.contacts.len()];
        for (index, body) in model.motion.bodies.iter_mut().enumerate() {
            // All rows of a body begin on one path, which is its shift.
            let Some(row) = frame.body_of.iter().position(|of| usize::from(*of) == index) else { continue };
            let [path, jump] =
                [(&blocks, width[0]), (&jumps, width[1])].map(|(all, width)| &all[width * row..][..width]);
            let shift = [path, &vec![0.0; 3 * (highest - order)], jump].concat();
            let columns = shift.len();
            let all = [shift, vec![0.0; 3 * columns]].concat();
            body.blocks = Param::initialized(body.blocks.id, from_host(all, columns, device));
        }
        let begun: Tensor<2> = from_host(blocks, 3 * order, device);
        model.motion.position =
            model.motion.position.map(|all| all.slice_assign([0..frame.rows.len(), 0..3 * order], begun));
        if let Some(kinks) = &mut model.motion.kinks {
            kinks.jumps = Param::from_tensor(from_host(jumps, 3 * frame.contacts.len(), device));
        }
    }
    (initial.gaussians, model)
}

/// The networks that the configuration needs to form blur.
pub(super) fn networks(config: &Config) -> Networks {
    let blur = &config.method.blur;
    if blur.mode != BlurMode::Warp {
        return Networks::default();
    }
    let velocity = blur.velocity == VelocitySource::Network;
    Networks { velocity, peano: blur.peano && !velocity, weights: if blur.weights { blur.samples } else { 0 } }
}

/// Largest root mean square distance of the centres from their best polynomial, pixels, at which a remainder is not
/// needed: it would not show in a photo.
const REMAINDER_PIXELS: f64 = 0.5;

/// Standard deviations of the centre's own uncertainty that its distance from the best polynomial must exceed. The
/// residual of a high order alternates from frame to frame, so a test of correlation in time alone would take it for
/// noise.
const REMAINDER_DEVIATIONS: f64 = 3.0;

/// Whether the 3D remainder is used: it is configured, or the centre's distances from the best polynomial are visible
/// and are not noise. Decided once, before training, from the triangulated centres of moving objects: their residual
/// after the best order is known without a scene.
pub fn wants_remainder(cues: &Cues, config: &Config) -> bool {
    match config.method.motion.remainder {
        RemainderChoice::On => true,
        RemainderChoice::Off => false,
        RemainderChoice::Auto => cues.tracks.iter().any(|track| leaves_a_pattern(track, cues.scale.pixels_per_unit)),
    }
}

fn leaves_a_pattern(track: &Track, pixels_per_unit: f64) -> bool {
    let residuals: Vec<[f64; 3]> =
        track.centres.iter().map(|centre| (centre.position - track.path.position(centre.t)).to_array()).collect();
    let count = residuals.len().max(1) as f64;
    let rms = (residuals.iter().flatten().map(|x| x * x).sum::<f64>() / count).sqrt() * pixels_per_unit;
    // The uncertainty of a centroid seen by n cameras is smaller by sqrt(n) than that of one.
    let noise = track.centres.iter().map(|c| c.residual_px.powi(2) / c.cameras as f64).sum::<f64>() / count;
    let beyond_noise = rms > REMAINDER_DEVIATIONS * noise.sqrt();
    rms > REMAINDER_PIXELS && (beyond_noise || has_pattern(&residuals))
}

/// Centre and root mean square extent of the moving Gaussians.
pub fn remainder_frame(rows: &[u32], means: &[[f32; 3]], order: usize) -> RemainderFrame {
    let positions = positions(rows, means);
    let centre = mean(&positions).unwrap_or(DVec3::ZERO);
    RemainderFrame { centre: centre.to_array(), scale: spread(&positions, centre), order }
}

/// The objects as bodies, and the body of each moving Gaussian: the object on whose path it begins. Objects without
/// Gaussians are left out.
fn objects(tracks: &[Track], frame: &MotionFrame, means: &[[f32; 3]]) -> (Vec<BodyFrame>, Vec<u8>) {
    let mut parts = vec![Vec::new(); tracks.len()];
    for (index, position) in positions(&frame.rows, means).into_iter().enumerate() {
        parts[nearest(tracks, frame.window.t0, position)].push(index);
    }
    parts.retain(|part| !part.is_empty());
    body_frames(parts, frame, means)
}

/// Each body that stands apart, where no path tells objects, and the body of each moving Gaussian: the nearest.
fn apart(frame: &MotionFrame, means: &[[f32; 3]]) -> (Vec<BodyFrame>, Vec<u8>) {
    let moving: Vec<[f32; 3]> = frame.rows.iter().map(|row| means[*row as usize]).collect();
    let (bodies, _) = body_frames(bodies(&moving), frame, means);
    let nearest = |position: DVec3| {
        let distance = |body: &BodyFrame| position.distance_squared(DVec3::from(body.centre));
        let order = |a: &(usize, &BodyFrame), b: &(usize, &BodyFrame)| distance(a.1).total_cmp(&distance(b.1));
        bodies.iter().enumerate().min_by(order).map_or(NO_BODY, |(index, _)| index as u8)
    };
    let body_of = positions(&frame.rows, means).into_iter().map(nearest).collect();
    (bodies, body_of)
}

/// Bodies of parts that are given by indices of moving Gaussians, the first [`BODIES_MAX`], and the body of each.
fn body_frames(parts: Vec<Vec<usize>>, frame: &MotionFrame, means: &[[f32; 3]]) -> (Vec<BodyFrame>, Vec<u8>) {
    let all = positions(&frame.rows, means);
    let mut body_of = vec![NO_BODY; frame.rows.len()];
    let mut bodies = Vec::new();
    for part in parts.into_iter().take(BODIES_MAX) {
        let own: Vec<DVec3> = part.iter().map(|index| all[*index]).collect();
        part.iter().for_each(|index| body_of[*index] = bodies.len() as u8);
        let centre = mean(&own).unwrap_or(DVec3::ZERO);
        bodies.push(BodyFrame::new(centre.to_array(), spread(&own, centre)));
    }
    (bodies, body_of)
}

/// Most bodies of a scene to begin with.
const BODIES_MAX: usize = 64;

/// The positions of the moving Gaussians at `t0`.
fn positions(rows: &[u32], means: &[[f32; 3]]) -> Vec<DVec3> {
    rows.iter().map(|row| Vec3::from(means[*row as usize]).as_dvec3()).collect()
}

fn spread(positions: &[DVec3], centre: DVec3) -> f64 {
    let squares = positions.iter().map(|position| position.distance_squared(centre)).sum::<f64>();
    let spread = (squares / positions.len().max(1) as f64).sqrt();
    if spread > 0.0 { spread } else { 1.0 }
}
