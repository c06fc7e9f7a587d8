//! Bodies: neighbours that move alike while the field moves them are one. Each follows a smooth free motion and is bent
//! by nodes, until all frames are seen and it gets a law.

use burn::tensor::Device;
use gs_base::mean;
use gs_burn::Gaussians;
use gs_burn::adam::Adam;
use gs_burn::glam::DVec3;
use gs_datasets::View;
use gs_models::sparsedyn::Phase;
use gs_models::sparsedyn::bodies::basis::MOTION;
use gs_models::sparsedyn::bodies::fit::{Fitted, Poses, even_after, fit_law};
use gs_models::sparsedyn::bodies::parts::divided;
use gs_models::sparsedyn::bodies::{Bodies, Body, BodyFrame, Law, LawValues, NodeFrame, Term};

use super::config::{BodiesConfig, BodyUse, MotionModel};
use super::count::{bodies_at, laws_at};
use super::cues::warmup_steps;
use super::evidence::may_move;
use super::groups::{FEWEST, Lengths, alike, all_labelled};
use super::judges::{Judges, PHOTOS_WEIGHT, said};
use super::laws::with_laws;
use super::poses::{members, middle, nearest, paths, pixel_size, poses_of, rests, vectors, weights_of};
use super::update::forget;
use super::{Sparsedyn, Step};
use gs_train::fit::extrapolation::with_confidence;
use gs_train::fit::parameters::to_host;

/// Searches for bodies.
const EXAMINATIONS: usize = 8;

/// Gaussians of a node: their photos determine six numbers of it.
const OF_NODE: usize = 10;

/// Pixels by which a motion differs from an even one, a knot after the last frame seen, to be replaced by it: more than
/// tracking leaves of a velocity, and less than what loses a body.
const OTHERWISE_PIXELS: f64 = 3.0;

/// Standard deviation of a node's weight in distances to the nearest node: half way, neighbours weigh alike.
const NODE_WIDTH: f64 = 0.6;

/// A Gaussian that moves less than this while frames are seen is static under FreeGave, in the field's unit of length,
/// the size of the objects: its renderer freezes what moves by less than 0.01, in scenes about 1 unit large.
const FROZEN: f64 = 0.01;

/// The model after the events of a step: bodies are found, and given laws.
pub fn evolved(mut model: Sparsedyn, gaussians: &Gaussians, adam: &mut Adam, views: &[View], at: &Step) -> Sparsedyn {
    if at.step == warmup_steps(at.config) {
        model.examine_evidence(gaussians, at);
    }
    if at.step == at.config.steps && model.model == MotionModel::Freegave {
        model.freeze(gaussians, at);
    }
    if at.config.method.bodies.mode == BodyUse::Field || model.model != MotionModel::Rollout {
        return model;
    }
    let examinations = examinations(at);
    if examinations.contains(&at.step) {
        let is_last = examinations.last() == Some(&at.step);
        model = with_bodies(model, gaussians, adam, views, (at, is_last));
        model.go_on_evenly(seen_times(at), gaussians);
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

/// Finds bodies among the Gaussians that the field moves: neighbours that move alike. Those that move like a known body
/// beside them join it. Before the last search what rests stays with the field, because it may only be slow to begin.
fn with_bodies(
    mut model: Sparsedyn,
    gaussians: &Gaussians,
    adam: &mut Adam,
    views: &[View],
    (at, is_last): (&Step, bool),
) -> Sparsedyn {
    let config = &at.config.method.bodies;
    let known = model.frame.labels.clone();
    if members(&known, -1).len() < FEWEST || at.cues.times.len() < 2 {
        return model;
    }
    let seen = seen_times(at);
    let paths: Vec<Vec<DVec3>> = paths(&model, &model.first_positions(gaussians), seen);
    let weights = weights_of(&model, gaussians);
    let pixel = pixel_size(views, middle(&paths[0], &weights));
    let still = at.config.method.moving.still_pixels * pixel;
    let lengths = Lengths { pixel, still, noise: config.noise_pixels * pixel };
    let mut labels = alike(&paths, &weights, seen, &known, &lengths);
    if is_last {
        labels = all_labelled(&labels, &paths[0]).into_iter().map(Some).collect();
    }
    let mut bodies = model.bodies.as_ref().map(Bodies::all).unwrap_or_default();
    if bodies.is_empty() {
        model.frame.pixel = pixel;
        model.frame.knots = (at.cues.times.len() as f64 / config.knot_frames).ceil() as usize + 2;
    }
    let judges = Judges::after(0, seen, views, gaussians, at);
    let before = model.clone();
    for label in 0..labels.iter().flatten().max().map_or(0, |most| *most + 1) {
        let all = members(&labels, Some(label));
        let (of_bodies, own): (Vec<usize>, Vec<usize>) = all.into_iter().partition(|i| known[*i] >= 0);
        if !of_bodies.is_empty() {
            let near = |i: usize| nearest(&paths[0], paths[0][i], of_bodies.iter().copied()).map_or(-1, |j| known[j]);
            own.iter().for_each(|i| model.frame.labels[*i] = near(*i));
            continue;
        }
        let poses = poses_of(&paths, &own, &weights, seen);
        if !is_last && rests(&poses, still) {
            continue;
        }
        let frame = BodyFrame::of(poses.first.to_array(), Law::of(&[]), model.frame.span[1]);
        let body = |free: &Motion| Body { free: free.clone(), ..Body::of(frame.clone(), LawValues::REST) };
        let free = first_motion(&poses, |all| judges.errors_of(&before, &own, all.iter().map(body)));
        if !is_last && free.is_empty() {
            continue;
        }
        let places: Vec<DVec3> = own.iter().map(|i| paths[0][*i]).collect();
        let nodes = nodes_of(&places, bodies.len(), config).into_iter().map(|node| (node, Vec::new()));
        own.iter().for_each(|i| model.frame.labels[*i] = bodies.len() as i32);
        bodies.push(Body { nodes: nodes.collect(), ..body(&free) });
    }
    if model.frame.labels == known {
        return model;
    }
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

/// The columns of a free motion.
type Motion = Vec<[f64; MOTION]>;

/// The free motion that photos bear out best among rest, which has no columns, and smooth laws of the `poses`. The
/// field's paths alone are no good evidence of a rotation: its photos are few frames, and it may turn what slides.
/// `judge` gives the errors of the photos.
fn first_motion(poses: &Poses, judge: impl Fn(&[Motion]) -> Vec<Option<f64>>) -> Motion {
    let fitted: Vec<Fitted> = Law::SMOOTH.iter().filter_map(|law| fit_law(poses, *law)).collect();
    let mut all: Vec<Motion> = vec![Vec::new()];
    all.extend(fitted.iter().map(|fitted| free_of(&fitted.values)));
    let freedom = std::iter::once(0).chain(fitted.iter().map(|fitted| fitted.law.freedom()));
    let cost = |(error, freedom): (Option<f64>, usize)| said(error) + freedom as f64 * PHOTOS_WEIGHT.ln();
    let costs = judge(&all).into_iter().zip(freedom).map(cost);
    let best = costs.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(index, _)| index);
    all.swap_remove(best)
}

/// The free motion of a smooth law: even and accelerated columns.
fn free_of(values: &LawValues) -> Motion {
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
        let near = nearest(&centres, centres[node], (0..centres.len()).filter(|other| *other != node));
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

    /// Lets bodies move evenly after the times that are `seen` so far, where their functions of time say otherwise.
    fn go_on_evenly(&mut self, seen: &[f64], gaussians: &Gaussians) {
        let (Some(bodies), Some(until)) = (&self.bodies, seen.last()) else { return };
        if *until >= self.frame.span[1] {
            return;
        }
        let (span, places) = (self.frame.bodies_span(), self.first_places(gaussians));
        let soon = until + (span.times[1] - span.times[0]) / span.knots as f64;
        let on = |(index, body): (usize, Body)| {
            let own = members(&self.frame.labels, index as i32);
            let centre = DVec3::from_array(body.frame.centre);
            let even = Body { free: even_after(&body, &span, *until), ..body.clone() };
            let [a, b] = [&body, &even].map(|body| body.pose(&span, soon));
            let apart = |i: &usize| a.apply(places[*i], centre).distance(b.apply(places[*i], centre));
            let farthest = own.iter().map(apart).fold(0.0, f64::max);
            if farthest > OTHERWISE_PIXELS * self.frame.pixel { even } else { body }
        };
        let all: Vec<Body> = bodies.all().into_iter().enumerate().map(on).collect();
        self.bodies = Some(Bodies::new(&all, span, &gaussians.device()));
    }

    /// Makes static what hardly moves while frames are seen.
    fn freeze(&mut self, gaussians: &Gaussians, at: &Step) {
        let first = self.first_places(gaussians);
        let paths = paths(self, &self.first_positions(gaussians), &at.cues.times);
        let least = FROZEN * self.frame.length;
        let rests = |i: &usize| paths.iter().all(|path| path[*i].distance(first[*i]) < least);
        let resting: Vec<usize> = (0..first.len()).filter(rests).collect();
        tracing::info!(resting = resting.len(), of = first.len(), "Gaussians that hardly moved were frozen");
        self.make_static(&resting);
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
        self.body_rows().into_iter().map(|(count, words)| format!("{count} Gaussians: {words}")).collect()
    }

    /// The Gaussians of each body, and its law in words with how sure it is.
    pub(super) fn body_rows(&self) -> Vec<(usize, String)> {
        let of = |body: usize| self.frame.labels.iter().filter(|label| **label == body as i32).count();
        let words = |frame: &BodyFrame| with_confidence(&self.frame.words(frame), frame.confidence);
        self.frame.bodies.iter().enumerate().map(|(body, frame)| (of(body), words(frame))).collect()
    }
}
