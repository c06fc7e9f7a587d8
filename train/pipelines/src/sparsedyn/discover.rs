//! Bodies: neighbours that move alike while the field moves them are one. Each follows a smooth free motion and is bent
//! by nodes, until all frames are seen and it gets a law.

use burn::tensor::Device;
use gs_base::{mean, median};
use gs_burn::Gaussians;
use gs_burn::adam::Adam;
use gs_burn::glam::DVec3;
use gs_datasets::View;
use gs_models::sparsedyn::Phase;
use gs_models::sparsedyn::bodies::parts::divided;
use gs_models::sparsedyn::bodies::{
    Bodies, Body, BodyFrame, Law, LawValues, NodeFrame, SegmentOptions, Term, segment, select_law,
};

use super::config::{BodiesConfig, BodyUse, MotionModel};
use super::count::{bodies_at, laws_at};
use super::cues::warmup_steps;
use super::evidence::may_move;
use super::laws::with_laws;
use super::poses::{members, middle, nearest, paths, pixel_size, poses_of, rests, vectors, weights_of};
use super::update::forget;
use super::{Sparsedyn, Step};
use gs_train::fit::parameters::to_host;

/// Searches for bodies.
const EXAMINATIONS: usize = 8;

/// Fewest Gaussians of a body: fewer do not determine a rotation in the noise of their positions.
const FEWEST: usize = 12;

/// Gaussians of a node: their photos determine six numbers of it.
const OF_NODE: usize = 10;

/// Standard deviation of a node's weight in distances to the nearest node: half way, neighbours weigh alike.
const NODE_WIDTH: f64 = 0.6;

/// Gaussians of one body lie within this many times the median distance to the nearest one.
const LINK: f64 = 3.0;

/// Times at which paths are compared with a rigid motion.
const PATH_TIMES: usize = 12;

/// Share of a Gaussian's distance from where it began that is added to the tolerance of a rigid group: the error of a
/// path grows with its length.
const TOLERANCE_SHARE: f64 = 0.08;

/// Most rigid groups.
const MOST: usize = 12;

/// Smallest share of a rigid group among the Gaussians that move.
const SHARE_LEAST: f64 = 0.02;

/// Difference of the ways of two such Gaussians that is allowed, as a share of the longer one, beside the noise of
/// both: paths of the field err by a tenth of their length, and neighbours in a body that bends move nearly alike; what
/// one of them leaves behind differs by the way itself.
const UNLIKE_SHARE: f64 = 0.25;

/// Largest distance of a path from the motion of its rigid group, pixels, where the path begins.
const GROUP_PIXELS: f64 = 2.0;

/// The model after the events of a step: bodies are found, and given laws.
pub fn evolved(mut model: Sparsedyn, gaussians: &Gaussians, adam: &mut Adam, views: &[View], at: &Step) -> Sparsedyn {
    if at.step == warmup_steps(at.config) {
        model.examine_evidence(gaussians, at);
    }
    if at.config.method.bodies.mode == BodyUse::Field || model.model != MotionModel::Rollout {
        return model;
    }
    let examinations = examinations(at);
    if examinations.contains(&at.step) {
        let is_last = examinations.last() == Some(&at.step);
        model = with_bodies(model, gaussians, adam, views, (at, is_last));
    }
    if at.step == laws_at(at.config) {
        model = with_laws(model, gaussians, adam, views, at);
    }
    model
}

/// The steps at which bodies are looked for, until all frames are seen: what begins to move late is found late.
pub(super) fn examinations(at: &Step) -> Vec<usize> {
    let (first, laws) = (bodies_at(at.config), laws_at(at.config));
    let all_seen = warmup_steps(at.config) + at.cues.curriculum(at.config).long_from();
    let last = all_seen.clamp(first, laws.saturating_sub(1).max(first));
    let mut steps: Vec<usize> = (0..EXAMINATIONS).map(|k| first + (last - first) * k / (EXAMINATIONS - 1)).collect();
    steps.dedup();
    steps
}

/// Finds bodies among the Gaussians that the field moves: neighbours that move alike. Before the last
/// examination what rests stays with the field, because it may only be slow to begin.
fn with_bodies(
    mut model: Sparsedyn,
    gaussians: &Gaussians,
    adam: &mut Adam,
    views: &[View],
    (at, is_last): (&Step, bool),
) -> Sparsedyn {
    let (config, still) = (&at.config.method.bodies, at.config.method.moving.still_pixels);
    let free: Vec<usize> = (0..model.frame.rows.len()).filter(|i| model.frame.labels[*i] < 0).collect();
    if free.len() < FEWEST || at.cues.times.len() < 2 {
        return model;
    }
    let seen = seen_times(at);
    let of_free = |time: Vec<DVec3>| free.iter().map(|i| time[*i]).collect::<Vec<DVec3>>();
    let all: Vec<Vec<DVec3>> =
        paths(&model, &model.first_positions(gaussians), seen).into_iter().map(of_free).collect();
    let weights = weights_of(&model, gaussians, &free);
    let pixel = pixel_size(views, middle(&all[0], &weights));
    let groups = rigid_groups(&all, &weights, seen, (pixel, still * pixel));
    let labels = linked(&all, &groups, 2.0 * config.noise_pixels * pixel, FEWEST);
    let mut bodies = model.bodies.as_ref().map(Bodies::all).unwrap_or_default();
    let known = bodies.len();
    for label in 0..labels.iter().max().map_or(0, |most| *most + 1) {
        let members = members(&labels, label);
        let poses = poses_of(&all, &members, &weights, seen, config.noise_pixels * pixel);
        if !is_last && rests(&poses, still * pixel) {
            continue;
        }
        // A few frames bear out few terms, and a wild guess of the others is lost in the next frames.
        let fitted = select_law(&poses, &Law::SMOOTH);
        let places: Vec<DVec3> = members.iter().map(|i| all[0][*i]).collect();
        let nodes = nodes_of(&places, bodies.len(), config).into_iter().map(|node| (node, Vec::new()));
        members.iter().for_each(|i| model.frame.labels[free[*i]] = bodies.len() as i32);
        let free = fitted.map_or_else(Vec::new, |fitted| free_of(&fitted.values));
        let frame = BodyFrame::of(poses.first.to_array(), Law::of(&[]), model.frame.span[1]);
        bodies.push(Body { free, nodes: nodes.collect(), ..Body::of(frame, LawValues::REST) });
    }
    if bodies.len() == known {
        return model;
    }
    model.frame.pixel = pixel;
    model.frame.knots = (at.cues.times.len() as f64 / config.knot_frames).ceil() as usize + 2;
    let model = model.with_all(&bodies, &gaussians.device());
    forget(adam);
    tracing::info!(
        step = at.step,
        bodies = model.frame.bodies.len(),
        nodes = model.frame.nodes.len(),
        of_bodies = model.frame.labels.iter().filter(|label| **label >= 0).count(),
        "bodies were looked for"
    );
    model
}

/// The rigid group of each Gaussian that moves along `paths`; `None` for what rests, which is no evidence of one body,
/// and for what follows no rigid motion.
fn rigid_groups(paths: &[Vec<DVec3>], weights: &[f64], times: &[f64], (pixel, still): (f64, f64)) -> Vec<Option<u32>> {
    let step = paths.len().div_ceil(PATH_TIMES).max(1);
    let sampled: Vec<Vec<DVec3>> = paths.iter().step_by(step).cloned().collect();
    let options = SegmentOptions {
        tolerance: GROUP_PIXELS * pixel,
        relative: TOLERANCE_SHARE,
        most: MOST,
        fewest: FEWEST,
        share: SHARE_LEAST,
    };
    let mut groups = segment(&sampled, weights, &options);
    for group in 0..groups.iter().flatten().max().map_or(0, |most| *most + 1) {
        let members = members(&groups, Some(group));
        if !members.is_empty() && rests(&poses_of(paths, &members, weights, times, 0.0), still) {
            members.iter().for_each(|i| groups[*i] = None);
        }
    }
    groups
}

/// The body of each Gaussian, from 0 on: the connected groups of neighbours that move alike along `paths`,
/// which err by `noise`, scene units, and of Gaussians of one rigid group. Groups of fewer than `fewest` go with the
/// nearest larger one.
fn linked(paths: &[Vec<DVec3>], groups: &[Option<u32>], noise: f64, fewest: usize) -> Vec<i32> {
    let Some(first) = paths.first() else { return Vec::new() };
    let count = first.len();
    let next = |i: usize| Some(first[i].distance(first[nearest(first, i, (0..count).filter(|j| *j != i))?]));
    let link = LINK * median((0..count).filter_map(next).collect()).unwrap_or(0.0);
    let move_alike = |now: &[DVec3], i: usize, j: usize| {
        let way = now[i].distance(first[i]).max(now[j].distance(first[j]));
        (now[i] - first[i]).distance(now[j] - first[j]) <= noise + UNLIKE_SHARE * way
    };
    let are_linked = |i: usize, j: usize| {
        let is_near = first[i].distance(first[j]) <= link;
        groups[i].is_some() && groups[i] == groups[j] || is_near && paths.iter().all(|now| move_alike(now, i, j))
    };
    let mut labels = vec![-1; count];
    let mut sizes: Vec<usize> = Vec::new();
    for start in 0..count {
        if labels[start] >= 0 {
            continue;
        }
        let (own, mut open) = (sizes.len() as i32, vec![start]);
        labels[start] = own;
        sizes.push(0);
        while let Some(i) = open.pop() {
            sizes[own as usize] += 1;
            for j in (0..count).filter(|j| labels[*j] < 0 && are_linked(i, *j)).collect::<Vec<_>>() {
                labels[j] = own;
                open.push(j);
            }
        }
    }
    let is_large = |i: usize| sizes[labels[i] as usize] >= fewest;
    let large: Vec<usize> = (0..count).filter(|i| is_large(*i)).collect();
    let joined = |i: usize| {
        let near = || nearest(first, i, large.iter().copied()).map_or(0, |near| labels[near]);
        if is_large(i) { labels[i] } else { near() }
    };
    let joined: Vec<i32> = (0..count).map(joined).collect();
    let mut names = joined.clone();
    names.sort_unstable();
    names.dedup();
    joined.iter().map(|label| names.binary_search(label).unwrap_or(0) as i32).collect()
}

/// The free motion of a smooth law: even and accelerated columns.
fn free_of(values: &LawValues) -> Vec<[f64; 6]> {
    let six = |shift: Term, turn: Term| {
        let (shift, turn) = (values.vector(shift).to_array(), values.vector(turn).to_array());
        std::array::from_fn(|k| if k < 3 { shift[k] } else { turn[k - 3] })
    };
    vec![six(Term::Velocity, Term::Spin), six(Term::Acceleration, Term::SpinUp)]
}

/// Nodes among the Gaussians at `places` of the body with a number; none where they are too few for two.
fn nodes_of(places: &[DVec3], body: usize, config: &BodiesConfig) -> Vec<NodeFrame> {
    let (labels, of) = divided(places, &vec![0; places.len()], config.nodes, OF_NODE);
    if of.len() < 2 {
        return Vec::new();
    }
    let centre = |node: usize| {
        let own: Vec<DVec3> = members(&labels, node as i32).into_iter().map(|i| places[i]).collect();
        mean(&own).unwrap_or(DVec3::ZERO)
    };
    let centres: Vec<DVec3> = (0..of.len()).map(centre).collect();
    let next = |node: usize| {
        let near = nearest(&centres, node, (0..centres.len()).filter(|other| *other != node));
        near.map_or(f64::INFINITY, |near| centres[near].distance(centres[node]))
    };
    let width = |node: usize| (NODE_WIDTH * next(node)).max(f64::MIN_POSITIVE);
    (0..centres.len()).map(|node| NodeFrame { centre: centres[node].to_array(), width: width(node), body }).collect()
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

    /// The model with the bodies `all`.
    pub(super) fn with_all(mut self, all: &[Body], device: &Device) -> Self {
        let bodies = Bodies::new(all, self.frame.bodies_span(), device);
        (self.frame.bodies, self.frame.nodes) = (bodies.frames.clone(), bodies.node_frames.clone());
        self.bodies = (!all.is_empty()).then_some(bodies);
        self
    }

    /// Where the moving Gaussians are in the first frame.
    pub fn first_places(&self, gaussians: &Gaussians) -> Vec<DVec3> {
        vectors(to_host(self.first_positions(gaussians)))
    }

    /// Each body's size and law in words.
    pub fn body_lines(&self) -> Vec<String> {
        let of = |body: usize| self.frame.labels.iter().filter(|label| **label == body as i32).count();
        let frames = self.frame.bodies.iter().enumerate();
        frames.map(|(body, frame)| format!("{} Gaussians: {}", of(body), self.frame.words(frame))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two rows of Gaussians, one of which begins to move away, and a stray one.
    #[test]
    fn neighbours_that_keep_their_distance_are_one_body() {
        let row = |y: f64| (0..20).map(move |i| DVec3::new(0.1 * f64::from(i), y, 0.0));
        let first: Vec<DVec3> = row(0.0).chain(row(0.1)).chain([DVec3::new(0.5, 3.0, 0.0)]).collect();
        let moved = |by: f64| -> Vec<DVec3> {
            let shift = |i: usize| DVec3::Y * if (20..40).contains(&i) { by } else { 0.0 };
            first.iter().enumerate().map(|(i, at)| *at + shift(i)).collect()
        };
        let alone = [None; 41];
        assert_eq!(linked(&[first.clone(), moved(0.01)], &alone, 0.01, 12), [0; 41]);
        let paths = [first.clone(), moved(0.01), moved(0.5)];
        let apart = linked(&paths, &alone, 0.01, 12);
        assert!(
            apart[..20].iter().all(|label| *label == 0) && apart[20..].iter().all(|label| *label == 1),
            "{apart:?}"
        );
        assert_eq!(linked(&paths, &[Some(3); 41], 0.01, 12), [0; 41], "one rigid group");
        assert!(linked(&[], &[], 0.01, 12).is_empty());
        assert_eq!(linked(&[first[..3].to_vec()], &alone[..3], 0.01, 12), [0; 3], "few are one body");
    }
}
