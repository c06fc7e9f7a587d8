//! The Gaussians of the first frame: at the back-projected pixels of depth priors, else at the data set's points, else
//! in the hull of outlines before a plain background, else where photos agree.

use burn::tensor::Device;
use gs_datasets::{PointCloud, Scene};
use gs_multiview::{HullOptions, foreground_masks, hull};

use super::clock::Clock;
use super::cues::{Cues, depths_of, frames};
use super::evidence::{may_move, swept};
use super::model::{Frame, Sparsedyn};
use super::sources::{Source, are_in_view};
use super::{Config, Step};
use gs_train::fit::initialise::{InitialGaussians, Random, gaussians_at, initial_gaussians, points_in_front};

/// Least weight of a prior's pixel that becomes a point.
const LEAST_WEIGHT: f32 = 0.25;

/// Most points throughout the hull of outlines. From 5,000 to 20,000 the first frame of held-out cameras is the same
/// within 0.15 dB, on eight object sets of five cameras.
const HULL_POINTS: usize = 10_000;

/// The state before the first step.
pub fn begin(scene: &Scene, at: &Step, device: &Device) -> (InitialGaussians, Sparsedyn) {
    let (cues, config) = (at.cues, at.config);
    let first = first_frame(scene, cues);
    let mut points = first_points(scene, &first, cues, config.density.cap);
    if points.is_empty() && first.points.is_none() {
        let count = config.init.random_points.min(config.density.cap);
        tracing::info!(
            "neither points, priors nor a plain background: the recipe sparsedyn/room is made for such scenes"
        );
        points = points_in_front(&first.train, count, at.facts.extent, &Random::STATIC_CAMERAS, config.seed);
    }
    let initial = match points.is_empty() {
        false => gaussians_at(&points, at.facts.extent, &config.init, config.density.cap, config.seed),
        true => initial_gaussians(
            &first.train,
            first.points.as_ref(),
            &config.init,
            config.density.cap,
            at.facts.extent,
            at.facts.region,
            config.seed,
        ),
    };
    let rows = may_move(&initial.means, &cues.evidence);
    let (centre, spread) = extent_of(&initial.means, &rows);
    // A small object that moves far is learned in steps of its way, not of its size.
    let length = spread.max(swept(&cues.evidence, centre.into()));
    let frame = Frame {
        clock: cues.clock,
        labels: vec![-1; rows.len()],
        rows,
        bodies: Vec::new(),
        nodes: Vec::new(),
        knots: 0,
        pixel: 1.0,
        start: cues.start(),
        span: [cues.start(), cues.times.last().copied().unwrap_or(0.0)],
        step: config.method.dynamics.step_frames * cues.interval,
        centre,
        length,
    };
    let model = Sparsedyn::new(frame, &config.method.dynamics, config.seed, device);
    (initial, model)
}

/// The scene with the training views of the first frame alone: at other times photos show other states.
fn first_frame(scene: &Scene, cues: &Cues) -> Scene {
    let first = cues.by_frame.first().map(Vec::as_slice).unwrap_or_default();
    let train = first.iter().map(|index| scene.train[*index].clone()).collect();
    let mut first = Scene { train, held_out: Vec::new(), points: None, warnings: Vec::new(), ..*scene };
    first.points = scene.points.clone().filter(|points| are_in_view(points, &first.train));
    if let Some(points) = scene.points.as_ref().filter(|points| first.points.is_none() && !points.is_empty()) {
        tracing::warn!(
            "no photo of the first frame shows any of the data set's {} points: they are left out",
            points.len()
        );
    }
    first
}

/// The points of the depth priors; without priors those throughout the visual hull of what stands before a plain
/// background, of which photos leave the surfaces. Empty: neither is there.
fn first_points(scene: &Scene, first: &Scene, cues: &Cues, cap: usize) -> PointCloud {
    let points = prior_points(scene, cues);
    if !points.is_empty() || first.points.is_some() {
        return points;
    }
    let Some(masks) = foreground_masks(&first.train) else { return points };
    // Outlines before a plain background are exact, so none may miss the object.
    let options = HullOptions { points: HULL_POINTS.min(cap), filled: true, misses: Some(0), ..HullOptions::default() };
    let hull = hull(first, &masks, cues.clock.outer(cues.start()), &options);
    hull.notes.iter().for_each(|note| tracing::info!("{note}"));
    tracing::info!(
        points = hull.points.len(),
        cameras = hull.cameras,
        "no points in the data set: carved the outlines' hull"
    );
    hull.points
}

/// Whether neither points nor priors nor outlines before a plain background tell where the first frame's Gaussians
/// begin.
pub fn is_photos_alone(scene: &Scene) -> bool {
    let (_, by_frame) = frames(&scene.train);
    let first = by_frame.first().map(Vec::as_slice).unwrap_or_default();
    Source::of(scene, first, !depths_of(&scene.train, first).is_empty()) == Source::Photos
}

/// The pixels of all priors of the first frame in space, with the photos' colours: the dense and redundant union of the
/// views.
fn prior_points(scene: &Scene, cues: &Cues) -> PointCloud {
    let mut points = PointCloud::default();
    for (index, prior) in &cues.depths {
        let view = &scene.train[*index];
        for (pixel, (depth, weight)) in prior.depth.iter().zip(&prior.weights).enumerate() {
            if *weight < LEAST_WEIGHT {
                continue;
            }
            let (position, color) = view.point_at(pixel, f64::from(*depth));
            if position.iter().all(|x| x.is_finite()) {
                points.positions.push(position);
                points.colors.push(color);
            }
        }
    }
    points
}

/// The middle of the rows and their root mean square distance from it; of all rows if none is listed.
fn extent_of(means: &[[f32; 3]], rows: &[u32]) -> ([f64; 3], f64) {
    let all: Vec<u32> = (0..means.len() as u32).collect();
    let rows = if rows.is_empty() { &all } else { rows };
    let at = |row: &u32| glam::Vec3::from(means[*row as usize]).as_dvec3();
    let count = rows.len().max(1) as f64;
    let middle = rows.iter().map(at).sum::<glam::DVec3>() / count;
    let spread = (rows.iter().map(|row| at(row).distance_squared(middle)).sum::<f64>() / count).sqrt();
    (middle.to_array(), if spread > 0.0 { spread } else { 1.0 })
}

/// A module for Gaussians that are known at one time alone.
pub fn at_rest(config: &Config, device: &Device) -> Sparsedyn {
    let frame = Frame {
        clock: Clock::default(),
        rows: Vec::new(),
        labels: Vec::new(),
        bodies: Vec::new(),
        nodes: Vec::new(),
        knots: 0,
        pixel: 1.0,
        start: 0.0,
        span: [0.0, 1.0],
        step: 1.0,
        centre: [0.0; 3],
        length: 1.0,
    };
    Sparsedyn::new(frame, &config.method.dynamics, config.seed, device)
}
