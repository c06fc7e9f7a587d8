//! Rigid bodies: found in the paths of the field, followed by a smooth free motion, then given the simplest law that their poses bear out.

use std::collections::BTreeMap;

use burn::tensor::Tensor;
use gs_burn::Gaussians;
use gs_burn::adam::Adam;
use gs_burn::glam::DVec3;
use gs_datasets::View;
use gs_models::sparsedyn::Phase;
use gs_models::sparsedyn::bodies::fit::Poses;
use gs_models::sparsedyn::bodies::rigid::rigid_motion;
use gs_models::sparsedyn::bodies::{
    Bodies, BodyFrame, BodyPose, Law, LawValues, SegmentOptions, fit_law, segment, select_law,
};

use super::config::{BodyUse, MotionModel};
use super::cues::warmup_steps;
use super::{Sparsedyn, Step};
use crate::fit::parameters::to_host;

/// Times at which paths are compared with a rigid motion.
const PATH_TIMES: usize = 12;

/// Fewest Gaussians of a body: fewer do not determine a rotation in the noise of their positions.
const FEWEST: usize = 12;

/// The model after the events of a step: bodies are found, laws are chosen.
pub fn simplified(model: Sparsedyn, gaussians: &Gaussians, adam: &mut Adam, views: &[View], at: &Step) -> Sparsedyn {
    let config = &at.config.method.bodies;
    if config.mode == BodyUse::Field || model.model != MotionModel::Rollout {
        return model;
    }
    let warmup = warmup_steps(at.config);
    let physics = at.config.steps - warmup;
    let due = |share: f64| at.step == warmup + ((share * physics as f64) as usize).max(1);
    let mut model = model;
    if due(config.from) {
        model = with_bodies(model, gaussians, adam, views, at);
    }
    if due(config.select) || (at.step == at.config.steps && model.frame.knots > 0) {
        model = with_laws(model, adam, views, at);
    }
    model
}

/// Finds bodies in the paths of the field.
fn with_bodies(mut model: Sparsedyn, gaussians: &Gaussians, adam: &mut Adam, views: &[View], at: &Step) -> Sparsedyn {
    let config = &at.config.method.bodies;
    if model.frame.rows.is_empty() || at.cues.times.len() < 2 {
        return model;
    }
    let first = model.first_positions(gaussians);
    let seen = seen_times(at);
    let sampled = evenly(seen, PATH_TIMES);
    let paths: Vec<Vec<DVec3>> = paths(&model, &first, &sampled);
    let opacities = to_host(gaussians.opacities());
    let weights: Vec<f64> = model.frame.rows.iter().map(|row| f64::from(opacities[*row as usize])).collect();
    let pixel = pixel_size(views, middle(&paths[0], &weights));
    let options = SegmentOptions {
        tolerance: config.tolerance_pixels * pixel,
        relative: config.tolerance_share,
        most: config.most,
        fewest: FEWEST,
        share: config.share,
    };
    let mut labels = segment(&paths, &weights, &options);
    let count = labels.iter().flatten().max().map_or(0, |most| *most as usize + 1);
    if count == 0 {
        tracing::info!(step = at.step, "no rigid body was found: the field moves everything");
        return model;
    }
    if config.mode == BodyUse::Bodies {
        to_nearest(&mut labels, &paths[0]);
    }
    let all = self::paths(&model, &first, seen);
    let still = at.config.method.moving.still_pixels.max(config.tolerance_pixels) * pixel;
    let (mut frames, mut values, mut numbers) = (Vec::new(), Vec::new(), BTreeMap::new());
    let mut resting = Vec::new();
    for body in 0..count as u32 {
        let members: Vec<usize> = (0..labels.len()).filter(|i| labels[*i] == Some(body)).collect();
        if members.len() < 3 {
            continue;
        }
        let poses = poses_of(&all, &members, &weights, seen, config.noise_pixels * pixel);
        if rests(&poses, still) {
            resting.push(body);
            continue;
        }
        let Some(fitted) = fit_law(&poses, Law::GENERAL) else { continue };
        numbers.insert(body, frames.len() as i32);
        frames.push(BodyFrame { centre: poses.first.to_array(), law: Law::GENERAL });
        values.push(fitted.values);
    }
    model.frame.labels =
        labels.iter().map(|label| label.and_then(|label| numbers.get(&label).copied()).unwrap_or(-1)).collect();
    let stays: Vec<bool> = labels.iter().map(|label| !label.is_some_and(|label| resting.contains(&label))).collect();
    model.keep_rows(&stays);
    model.frame.knots = (at.cues.times.len() as f64 / config.knot_frames).ceil() as usize + 3;
    model.set_bodies(frames, &values, gaussians);
    forget(adam);
    tracing::info!(
        step = at.step,
        bodies = model.frame.bodies.len(),
        of_bodies = model.frame.labels.iter().filter(|label| **label >= 0).count(),
        of_field = model.frame.labels.iter().filter(|label| **label < 0).count(),
        "rigid bodies were found"
    );
    model
}

/// The times of the frames that the window of the curriculum holds at this step: of later ones the field knows nothing.
fn seen_times<'a>(at: &Step<'a>) -> &'a [f64] {
    let times = &at.cues.times;
    match at.cues.curriculum(at.config).phase(at.step - warmup_steps(at.config)) {
        Phase::Short { frames } => &times[..frames.clamp(2, times.len())],
        Phase::Long => times,
    }
}

/// Gives each body the law that its poses bear out, and drops the free motion.
fn with_laws(mut model: Sparsedyn, adam: &mut Adam, views: &[View], at: &Step) -> Sparsedyn {
    let config = &at.config.method.bodies;
    let Some(bodies) = &model.bodies else { return model };
    let poses: Vec<Vec<BodyPose>> = at.cues.times.iter().map(|time| bodies.poses(*time)).collect();
    let (mut frames, mut values) = (bodies.frames.clone(), bodies.values());
    for (body, frame) in frames.iter_mut().enumerate() {
        let first = DVec3::from_array(frame.centre);
        let pixel = pixel_size(views, first);
        let sequence = |(time, poses): (&f64, &Vec<BodyPose>)| (time - model.frame.start, poses[body]);
        let sequence = Poses {
            first,
            size: 0.5 * model.frame.length,
            poses: at.cues.times.iter().zip(&poses).map(sequence).collect(),
            independent: at.cues.times.len() as f64 / config.knot_frames,
            noise: config.noise_pixels * pixel,
        };
        for fitted in gs_models::sparsedyn::bodies::compare_laws(&sequence, &Law::ALL) {
            eprintln!(
                "LAW {body} {} | dev {:.3} fore {:.3} bic {:.1} free {}",
                fitted.law.in_words(),
                fitted.deviation / pixel,
                fitted.foreseen / pixel,
                fitted.bic,
                fitted.law.freedom()
            );
        }
        if let Some(fitted) = select_law(&sequence, &Law::ALL) {
            let deviation = fitted.deviation / pixel;
            tracing::info!(
                step = at.step,
                body,
                law = fitted.law.in_words(),
                deviation_pixels = deviation,
                "law of a body"
            );
            (frame.law, values[body]) = (fitted.law, fitted.values);
        }
    }
    model.frame.knots = 0;
    let device = bodies.numbers.val().device();
    model.frame.bodies = frames.clone();
    model.bodies = Some(Bodies::new(frames, &values, model.frame.span, (model.frame.length, 0), &device));
    forget(adam);
    model
}

impl Sparsedyn {
    /// Keeps the moving rows at which `stays` is true; the others become static.
    fn keep_rows(&mut self, stays: &[bool]) {
        let kept = |index: &usize| stays[*index];
        let indices: Vec<usize> = (0..self.frame.rows.len()).filter(kept).collect();
        self.frame.labels = indices.iter().map(|index| self.frame.labels[*index]).collect();
        self.frame.rows = indices.iter().map(|index| self.frame.rows[*index]).collect();
    }

    fn set_bodies(&mut self, frames: Vec<BodyFrame>, values: &[LawValues], gaussians: &Gaussians) {
        self.frame.bodies = frames.clone();
        let size = (self.frame.length, self.frame.knots);
        self.bodies = match frames.is_empty() {
            true => None,
            false => Some(Bodies::new(frames, values, self.frame.span, size, &gaussians.device())),
        };
    }

    /// Each body's size and law in words.
    pub fn body_lines(&self) -> Vec<String> {
        let of = |body: usize| self.frame.labels.iter().filter(|label| **label == body as i32).count();
        let frames = self.frame.bodies.iter().enumerate();
        frames.map(|(body, frame)| format!("{} Gaussians: {}", of(body), frame.law.in_words())).collect()
    }
}

/// Old moments belong to numbers of another meaning.
fn forget(adam: &mut Adam) {
    for path in ["method.bodies.numbers", "method.bodies.corrections"] {
        adam.forget(path);
    }
}

/// The positions of the moving Gaussians at `times`.
fn paths(model: &Sparsedyn, first: &Tensor<2>, times: &[f64]) -> Vec<Vec<DVec3>> {
    let moved = model.moved(first, times);
    let host = moved.into_iter().map(|moved| to_host(moved.state.positions));
    host.map(|values| values.chunks_exact(3).map(|x| DVec3::new(x[0].into(), x[1].into(), x[2].into())).collect())
        .collect()
}

/// The poses of a body at all frames.
fn poses_of(paths: &[Vec<DVec3>], members: &[usize], weights: &[f64], times: &[f64], noise: f64) -> Poses {
    let at = |time: &Vec<DVec3>| members.iter().map(|i| time[*i]).collect::<Vec<DVec3>>();
    let before = at(&paths[0]);
    let own: Vec<f64> = members.iter().map(|i| weights[*i]).collect();
    let first = middle(&before, &own);
    let spread = before.iter().map(|x| x.distance_squared(first)).sum::<f64>() / before.len() as f64;
    let pose = |(time, path): (&f64, &Vec<DVec3>)| (time - times[0], rigid_motion(&before, &at(path), first));
    Poses {
        first,
        size: spread.sqrt(),
        poses: times.iter().zip(paths).map(pose).collect(),
        independent: times.len() as f64,
        noise,
    }
}

/// Whether no marker of a body moves by more than `still`, scene units.
fn rests(poses: &Poses, still: f64) -> bool {
    let markers = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|axis| poses.first + poses.size * axis);
    let moved =
        |pose: &BodyPose| markers.map(|at| pose.apply(at, poses.first).distance(at)).into_iter().fold(0.0, f64::max);
    poses.poses.iter().all(|(_, pose)| moved(pose) <= still)
}

fn middle(positions: &[DVec3], weights: &[f64]) -> DVec3 {
    let total: f64 = weights.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    positions.iter().zip(weights).map(|(position, weight)| *position * *weight).sum::<DVec3>() / total
}

/// Scene units of a pixel at `position`, in the training view that shows it largest.
pub fn pixel_size(views: &[View], position: DVec3) -> f64 {
    let sizes = views.iter().filter_map(|view| {
        let depth = view.c2w.inverse().transform_point3(position).z;
        (depth > 0.0).then(|| depth / view.intrinsics.fx)
    });
    let least = sizes.fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 1.0 }
}

/// At most `count` of `times`, the first and the last among them.
fn evenly(times: &[f64], count: usize) -> Vec<f64> {
    if times.len() <= count {
        return times.to_vec();
    }
    (0..count).map(|k| times[k * (times.len() - 1) / (count - 1)]).collect()
}

/// Gives each Gaussian without a body that of the nearest Gaussian with one.
fn to_nearest(labels: &mut [Option<u32>], first: &[DVec3]) {
    let known: Vec<(DVec3, u32)> = labels.iter().zip(first).filter_map(|(label, at)| Some((*at, (*label)?))).collect();
    for (label, at) in labels.iter_mut().zip(first) {
        let nearest = known.iter().min_by(|a, b| a.0.distance_squared(*at).total_cmp(&b.0.distance_squared(*at)));
        *label = label.or(nearest.map(|(_, body)| *body));
    }
}
