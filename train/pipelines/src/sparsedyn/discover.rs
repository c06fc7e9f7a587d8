//! Rigid bodies: found in the paths of the field while the window grows, followed by a smooth free motion, divided and
//! joined again where their parts move alike, then given laws: those that their poses bear out and photos confirm.

use gs_burn::Gaussians;
use gs_burn::adam::Adam;
use gs_burn::glam::DVec3;
use gs_datasets::View;
use gs_models::sparsedyn::Phase;
use gs_models::sparsedyn::bodies::fit::{MARKERS, Poses};
use gs_models::sparsedyn::bodies::parts::divided;
use gs_models::sparsedyn::bodies::{Bodies, BodyFrame, BodyPose, Law, LawValues, SegmentOptions, segment, select_law};

use super::config::{BodyUse, MotionModel};
use super::count::{bodies_at, laws_at};
use super::cues::warmup_steps;
use super::evidence::may_move;
use super::laws::with_laws;
use super::poses::{middle, paths, pixel_size, poses_of, vectors, weights_of};
use super::release::resting_parts;
use super::update::forget;
use super::{Sparsedyn, Step};
use gs_train::fit::parameters::to_host;

/// Times at which paths are compared with a rigid motion.
const PATH_TIMES: usize = 12;

/// Share of a Gaussian's distance from where it began that is added to the tolerance: the
/// error of a path grows with its length.
const TOLERANCE_SHARE: f64 = 0.08;

/// Most bodies. What moves beyond them is left to the field.
const MOST: usize = 12;

/// Smallest share of a body among the Gaussians that move and have no body yet. Smaller groups are left to the
/// field.
const SHARE_LEAST: f64 = 0.02;

/// Fewest Gaussians of a body: fewer do not determine a rotation in the noise of their positions.
const FEWEST: usize = 12;

/// Fewest Gaussians of a part of a body: three bodies' worth, so that photos determine its rotation.
const FEWEST_OF_PART: usize = 3 * FEWEST;

/// The model after the events of a step: bodies are found and found again, divided, joined and given laws.
pub fn evolved(mut model: Sparsedyn, gaussians: &Gaussians, adam: &mut Adam, views: &[View], at: &Step) -> Sparsedyn {
    if at.step == warmup_steps(at.config) {
        model.examine_evidence(gaussians, at);
    }
    if at.config.method.bodies.mode == BodyUse::Field || model.model != MotionModel::Rollout {
        return model;
    }
    let events = Events::of(at);
    if events.examinations.contains(&at.step) {
        let last = events.examinations.last() == Some(&at.step);
        model = with_bodies(model, gaussians, adam, views, (at, last));
        if last {
            model = in_parts(model, gaussians, adam, at);
        }
    }
    if at.step == events.select || (at.step == at.config.steps && model.frame.knots > 0) {
        model = with_laws(model, gaussians, adam, views, at);
    }
    model
}

/// The steps at which bodies change.
pub(super) struct Events {
    /// Ascending; at the last one all frames were seen.
    pub examinations: Vec<usize>,
    /// The step at which each body gets its law.
    pub select: usize,
}

impl Events {
    pub fn of(at: &Step) -> Self {
        let config = &at.config.method.bodies;
        let warmup = warmup_steps(at.config);
        let select = laws_at(at.config) - warmup;
        let first = (bodies_at(at.config) - warmup).max(1).min(select);
        let last = at.cues.curriculum(at.config).long_from().clamp(first, select.saturating_sub(1).max(first));
        let count = config.examinations.max(1);
        let mut examinations: Vec<usize> =
            (0..count).map(|k| warmup + first + (last - first) * k / (count - 1).max(1)).collect();
        examinations.dedup();
        Self { examinations, select: warmup + select }
    }
}

/// Finds bodies in the paths of the Gaussians that the field moves. At the last examination what rests becomes static:
/// before it, what rests may only be slow to begin.
fn with_bodies(
    mut model: Sparsedyn,
    gaussians: &Gaussians,
    adam: &mut Adam,
    views: &[View],
    (at, last): (&Step, bool),
) -> Sparsedyn {
    let config = &at.config.method.bodies;
    let free: Vec<usize> = (0..model.frame.rows.len()).filter(|i| model.frame.labels[*i] < 0).collect();
    let examined =
        (free.len() >= FEWEST && at.cues.times.len() > 1).then(|| examined(&model, gaussians, views, &free, at));
    let Examined { bodies, resting } = examined.unwrap_or_default();
    let known = model.frame.bodies.len();
    let (mut frames, mut values) = (Vec::new(), Vec::new());
    for body in bodies {
        body.members.iter().for_each(|i| model.frame.labels[*i] = (known + frames.len()) as i32);
        frames.push(BodyFrame { centre: body.centre.to_array(), law: Law::GENERAL });
        values.push(body.values);
    }
    if last {
        if config.mode == BodyUse::Bodies {
            let first = model.first_places(gaussians);
            to_nearest(&mut model.frame.labels, &first);
        }
        model.make_static(&resting);
    }
    if !frames.is_empty() {
        let knots = (at.cues.times.len() as f64 / config.knot_frames).ceil() as usize + 3;
        model.add_bodies(frames, &values, knots, gaussians);
        forget(adam);
    }
    let resting = resting_parts(&model, gaussians, seen_times(at), views, at);
    match last {
        true => model.make_static(&resting),
        // It may only be slow to begin.
        false => resting.iter().for_each(|index| model.frame.labels[*index] = -1),
    }
    tracing::info!(
        step = at.step,
        released = resting.len(),
        bodies = model.frame.bodies.len(),
        of_bodies = model.frame.labels.iter().filter(|label| **label >= 0).count(),
        of_field = model.frame.labels.iter().filter(|label| **label < 0).count(),
        "rigid bodies were looked for"
    );
    model
}

/// The outcome of an examination; Gaussians as indices among the moving ones.
#[derive(Default)]
struct Examined {
    bodies: Vec<Found>,
    /// Gaussians of bodies that rest.
    resting: Vec<usize>,
}

/// A body with its first motion.
struct Found {
    members: Vec<usize>,
    centre: DVec3,
    values: LawValues,
}

/// Bodies among the Gaussians `free`.
fn examined(model: &Sparsedyn, gaussians: &Gaussians, views: &[View], free: &[usize], at: &Step) -> Examined {
    let config = &at.config.method.bodies;
    let first = model.first_positions(gaussians);
    let seen = seen_times(at);
    let of_free = |all: Vec<Vec<DVec3>>| -> Vec<Vec<DVec3>> {
        all.into_iter().map(|time| free.iter().map(|i| time[*i]).collect()).collect()
    };
    let all = of_free(paths(model, &first, seen));
    let sampled: Vec<Vec<DVec3>> = evenly(&all, PATH_TIMES);
    let weights = weights_of(model, gaussians, free);
    let pixel = pixel_size(views, middle(&all[0], &weights));
    let options = SegmentOptions {
        tolerance: config.tolerance_pixels * pixel,
        relative: TOLERANCE_SHARE,
        most: MOST.saturating_sub(model.frame.bodies.len()),
        fewest: FEWEST,
        share: SHARE_LEAST,
    };
    let labels = segment(&sampled, &weights, &options);
    let still = at.config.method.moving.still_pixels * pixel;
    let mut found = Examined::default();
    for body in 0..labels.iter().flatten().max().map_or(0, |most| *most + 1) {
        let members: Vec<usize> = (0..free.len()).filter(|i| labels[*i] == Some(body)).collect();
        if members.len() < 3 {
            continue;
        }
        let poses = poses_of(&all, &members, &weights, seen, config.noise_pixels * pixel);
        let members: Vec<usize> = members.into_iter().map(|i| free[i]).collect();
        if rests(&poses, still) {
            found.resting.extend(members);
            continue;
        }
        // A few frames bear out few terms, and a wild guess of the others is lost in the next frames.
        let Some(fitted) = select_law(&poses, &Law::SMOOTH) else { continue };
        found.bodies.push(Found { members, centre: poses.first, values: fitted.values });
    }
    found
}

/// Divides bodies: until laws are chosen, each part follows its own photos.
fn in_parts(mut model: Sparsedyn, gaussians: &Gaussians, adam: &mut Adam, at: &Step) -> Sparsedyn {
    let most = at.config.method.bodies.parts;
    let Some(bodies) = model.bodies.take() else { return model };
    let (labels, of) = divided(&model.first_places(gaussians), &model.frame.labels, most, FEWEST_OF_PART);
    let bodies = bodies.copied(&of);
    model.frame.labels = labels;
    model.frame.bodies = bodies.frames.clone();
    model.bodies = Some(bodies);
    forget(adam);
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

impl Sparsedyn {
    /// Decides anew which Gaussians may move, by where they are now: the warm-up has shifted, added and removed some.
    fn examine_evidence(&mut self, gaussians: &Gaussians, at: &Step) {
        let means: Vec<[f32; 3]> = to_host(gaussians.means.val()).as_chunks().0.to_vec();
        self.frame.rows = may_move(&means, &at.cues.evidence);
        self.frame.labels = vec![-1; self.frame.rows.len()];
    }

    /// Makes moving Gaussians static, by their indices among the moving ones.
    pub(super) fn make_static(&mut self, resting: &[usize]) {
        let mut stays = vec![true; self.frame.rows.len()];
        resting.iter().for_each(|index| stays[*index] = false);
        let indices: Vec<usize> = (0..stays.len()).filter(|index| stays[*index]).collect();
        self.frame.labels = indices.iter().map(|index| self.frame.labels[*index]).collect();
        self.frame.rows = indices.iter().map(|index| self.frame.rows[*index]).collect();
    }

    fn add_bodies(&mut self, frames: Vec<BodyFrame>, values: &[LawValues], knots: usize, gaussians: &Gaussians) {
        self.frame.knots = knots;
        self.bodies = Some(match self.bodies.take() {
            Some(bodies) => bodies.extended(&frames, values),
            None => Bodies::new(frames, values, self.frame.span, (self.frame.length, knots), &gaussians.device()),
        });
        self.frame.bodies = self.bodies.as_ref().map(|bodies| bodies.frames.clone()).unwrap_or_default();
    }

    /// Where the moving Gaussians are in the first frame.
    pub fn first_places(&self, gaussians: &Gaussians) -> Vec<DVec3> {
        vectors(to_host(self.first_positions(gaussians)))
    }

    /// Each body's size and law in words.
    pub fn body_lines(&self) -> Vec<String> {
        let of = |body: usize| self.frame.labels.iter().filter(|label| **label == body as i32).count();
        let frames = self.frame.bodies.iter().enumerate();
        frames.map(|(body, frame)| format!("{} Gaussians: {}", of(body), frame.law.in_words())).collect()
    }
}

/// Whether no marker of a body moves by more than `still`, scene units.
fn rests(poses: &Poses, still: f64) -> bool {
    let markers = MARKERS.map(|axis| poses.first + poses.size * axis);
    let moved =
        |pose: &BodyPose| markers.map(|at| pose.apply(at, poses.first).distance(at)).into_iter().fold(0.0, f64::max);
    poses.poses.iter().all(|(_, pose)| moved(pose) <= still)
}

/// At most `count` of `items`, the first and the last among them.
fn evenly<T: Clone>(items: &[T], count: usize) -> Vec<T> {
    if items.len() <= count {
        return items.to_vec();
    }
    (0..count).map(|k| items[k * (items.len() - 1) / (count - 1)].clone()).collect()
}

/// Gives each Gaussian without a body that of the nearest Gaussian with one.
fn to_nearest(labels: &mut [i32], first: &[DVec3]) {
    let known: Vec<(DVec3, i32)> =
        labels.iter().zip(first).filter(|(label, _)| **label >= 0).map(|(label, at)| (*at, *label)).collect();
    for (label, at) in labels.iter_mut().zip(first).filter(|(label, _)| **label < 0) {
        let nearest = known.iter().min_by(|a, b| a.0.distance_squared(*at).total_cmp(&b.0.distance_squared(*at)));
        *label = nearest.map_or(-1, |(_, body)| *body);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaussians_of_no_body_go_with_the_nearest_one() {
        let first: Vec<DVec3> = (0..5).map(|i| DVec3::new(f64::from(i), 0.0, 0.0)).collect();
        let mut labels = [0, -1, -1, -1, 1];
        to_nearest(&mut labels, &first);
        assert_eq!(labels, [0, 0, 0, 1, 1], "the one in the middle goes with the first of two");
        let mut alone = [-1, -1];
        to_nearest(&mut alone, &first[..2]);
        assert_eq!(alone, [-1, -1], "without a body the field moves all");
    }
}
