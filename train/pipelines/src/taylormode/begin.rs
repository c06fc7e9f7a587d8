//! The state of a moving scene before the first step: initial Gaussians, the initial paths of moving ones, which are
//! those of their objects, and the networks that the configuration learns beside them.

use burn::module::Param;
use burn::tensor::{Device, Tensor};
use glam::{DVec3, Vec3};
use gs_base::mean;
use gs_datasets::Scene;
use gs_models::taylormode::order::has_pattern;
use gs_models::taylormode::{MotionFrame, RemainderFrame};
use gs_multiview::Track;

use super::bodies::bodies;
use super::common_motion::CommonMotion;
use super::config::{BlurMode, MaskSource, RemainderChoice, VelocitySource};
use super::cues::{Cues, first_exposure, window};
use super::initial_paths::{contacts, initial_paths, nearest, shape};
use super::initial_points::initial_points;
use super::model::{Networks, Units};
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
    let units = Units::new(at.facts.extent, window.half);
    let mut model = Taylormode::new(&frame, exposure, (networks(config), units), config.seed, device);
    model.stated_exposure = (choice.blur.exposure == 0.0 && guess.is_none()).then_some(exposure);
    if follows {
        let (blocks, jumps) = initial_paths(&cues.tracks, &frame, means, order);
        let begun: Tensor<2> = from_host(blocks, 3 * order, device);
        model.motion.position =
            model.motion.position.map(|all| all.slice_assign([0..frame.rows.len(), 0..3 * order], begun));
        if let Some(kinks) = &mut model.motion.kinks {
            kinks.jumps = Param::from_tensor(from_host(jumps, 3 * frame.contacts.len(), device));
        }
    }
    if highest > 0 && choice.motion.collective {
        let objects = match (follows, nothing_found) {
            (true, _) => object_frames(&cues.tracks, &frame, means),
            (false, true) => Vec::new(),
            (false, false) => body_frames(&frame, means),
        };
        model.objects =
            objects.into_iter().map(|(centre, size)| CommonMotion::new(centre, size, highest, device)).collect();
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

/// Centre and root mean square extent of each object; objects without Gaussians are left out. For several objects the
/// centre is the path's position at `t0`, so that a Gaussian stays with the object on whose path it began.
fn object_frames(tracks: &[Track], frame: &MotionFrame, means: &[[f32; 3]]) -> Vec<([f64; 3], f64)> {
    let t0 = frame.window.t0;
    let mut parts = vec![Vec::new(); tracks.len()];
    for position in positions(&frame.rows, means) {
        parts[nearest(tracks, t0, position)].push(position);
    }
    let filled = parts.into_iter().zip(tracks).filter(|(part, _)| !part.is_empty());
    let alone = tracks.len() == 1;
    let objects = filled.map(|(part, track)| {
        let centre = if alone { mean(&part).unwrap_or(DVec3::ZERO) } else { track.path.position(t0) };
        (centre.to_array(), spread(&part, centre))
    });
    objects.collect()
}

/// Centre and root mean square extent of each body that stands apart, where no path tells objects.
fn body_frames(frame: &MotionFrame, means: &[[f32; 3]]) -> Vec<([f64; 3], f64)> {
    let moving: Vec<[f32; 3]> = frame.rows.iter().map(|row| means[*row as usize]).collect();
    let bodies = bodies(&moving).into_iter().map(|body| {
        let rows: Vec<u32> = body.into_iter().map(|index| frame.rows[index]).collect();
        let own = positions(&rows, means);
        let centre = mean(&own).unwrap_or(DVec3::ZERO);
        (centre.to_array(), spread(&own, centre))
    });
    bodies.collect()
}

/// The positions of the moving Gaussians at `t0`.
fn positions(rows: &[u32], means: &[[f32; 3]]) -> Vec<DVec3> {
    rows.iter().map(|row| Vec3::from(means[*row as usize]).as_dvec3()).collect()
}

fn spread(positions: &[DVec3], centre: DVec3) -> f64 {
    let squares = positions.iter().map(|position| position.distance_squared(centre)).sum::<f64>();
    let spread = (squares / positions.len().max(1) as f64).sqrt();
    if spread > 0.0 { spread } else { 1.0 }
}
