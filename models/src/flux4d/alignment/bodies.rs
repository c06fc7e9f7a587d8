//! Bodies of each sweep and their motions.

use rayon::prelude::*;

use super::AlignedSweep;
use super::aligned::Aligned;
use super::candidate::{Candidate, SCORE_MIN, confirms, is_motion};
use super::evidence::places;
use super::footprint::Footprint;
use super::groups::{gap, joined, middle};
use super::plan::{Extent, Plan};
use super::search::{Other, PlanarMotion, score, search};
use super::shadow::Shadow;

/// Slowest motion that is told from rest, metres per second: 0.3 m in a window of a second, less than the reach.
const SPEED_MIN: f64 = 0.4;
/// Bodies with a gap of at most the first (metres: the beams of a LiDAR graze the side of a car 1 m apart at 20 m) are
/// one body where that costs at most the second of the score.
const UNITE_GAP: f64 = 3.0;
const UNITE_LOSS: f64 = 0.1;
/// Score that a body may lose by the motion of the sweep that shows more of it.
const ADOPT_LOSS: f64 = 0.02;

/// The scale at which bodies are looked for.
pub struct Scale {
    /// Distance up to which a place counts as near a point, metres.
    pub reach: f64,
    /// Edge of the cells by which points are joined, metres.
    pub join: f64,
    /// Fewest evident points of a body in a sweep.
    pub fewest: usize,
    /// Share of the other sweeps that need not count, the worst ones: what is hidden is not known for sure.
    pub unsure: f64,
    /// Sweeps in a row that may show nothing of a body.
    pub skipped: usize,
    /// Whether a body may be followed to points that by themselves show another motion.
    pub follows: bool,
    /// Whether velocities may change.
    pub bends: bool,
}

/// Bodies with a surface. The reach is two steps of a spinning LiDAR at 50 m, and the change of the visible side of a
/// car between sweeps; a person at 40 m has five points.
pub const FINE: Scale =
    Scale { reach: 0.4, join: 0.3, fewest: 5, unsure: 0.34, skipped: 0, follows: false, bends: true };
/// Bodies of a few beams, which meet the bumper in one sweep and the window 1.4 m behind it in another. Their places
/// are too vague for a change of velocity.
pub const COARSE: Scale =
    Scale { reach: 1.2, join: 0.75, fewest: 3, unsure: 0.5, skipped: 1, follows: true, bends: false };

/// The sweeps in which all bodies of a scale are looked for.
pub struct Snippet<'a> {
    /// All of them.
    pub sweeps: &'a [AlignedSweep<'a>],
    /// Extent of all points above the ground, metres.
    pub heights: &'a [Vec<f32>],
    /// The scale at which bodies are looked for.
    pub scale: Scale,
    /// The points of each sweep between which bodies are looked for.
    pub among: &'a [Vec<usize>],
    /// Of these points.
    plans: Vec<Plan>,
    /// The places that each sweep does not see.
    shadows: &'a [Shadow],
    /// The bodies found before.
    pub before: Option<Before<'a>>,
}

/// Bodies of a finer scale.
pub struct Before<'a> {
    /// Its plans show all standing points, by which what rests is known.
    pub snippet: &'a Snippet<'a>,
    /// Points that belong to a body keep it.
    pub found: &'a Aligned,
}

impl<'a> Snippet<'a> {
    /// At a scale in plans of an extent; bodies are looked for between the points `among` of each sweep.
    pub fn new(
        sweeps: &'a [AlignedSweep<'a>],
        heights: &'a [Vec<f32>],
        (scale, extent): (Scale, Extent),
        (shadows, among): (&'a [Shadow], &'a [Vec<usize>]),
    ) -> Self {
        let plan = |(sweep, among): (&AlignedSweep, &Vec<usize>)| Plan::new(places(sweep, among), extent, scale.reach);
        let plans = sweeps.par_iter().zip(among).map(plan).collect();
        Self { sweeps, heights, scale, among, plans, shadows, before: None }
    }

    /// The bodies whose evident points are given, and what belongs to them.
    pub fn bodies(&self, evident: &[Vec<usize>]) -> Aligned {
        let of_sweep = |sweep: usize| {
            let points: Vec<[f64; 2]> = places(&self.sweeps[sweep], &evident[sweep]).collect();
            let groups = joined(&points, self.scale.join);
            groups.into_iter().filter(|group| group.len() >= self.scale.fewest).map(move |group| (sweep, group))
        };
        let groups: Vec<(usize, Vec<[f64; 2]>)> = (0..self.sweeps.len()).flat_map(of_sweep).collect();
        let groups: Vec<Candidate> =
            groups.into_par_iter().map(|(sweep, evident)| self.searched(sweep, evident)).collect();
        let of_sweep = |sweep: usize| groups.iter().filter(move |group| group.sweep == sweep).cloned().collect();
        let bodies: Vec<Candidate> =
            (0..self.sweeps.len()).flat_map(|sweep| self.united(sweep, of_sweep(sweep))).collect();
        self.claimed(self.followed(bodies))
    }

    /// The other sweeps as seen from one, the nearest in time first.
    pub fn others(&self, sweep: usize) -> Vec<Other<'_>> {
        let other = |index: usize| Other {
            plan: &self.plans[index],
            shadow: &self.shadows[index],
            after: self.sweeps[index].time - self.sweeps[sweep].time,
        };
        let mut others: Vec<Other> =
            (0..self.sweeps.len()).filter(|i| *i != sweep && !self.sweeps[*i].points.is_empty()).map(other).collect();
        others.sort_by(|a, b| a.after.abs().total_cmp(&b.after.abs()));
        others
    }

    /// How well a motion explains points of a sweep to the `others`, 0 to 1.
    pub fn score(&self, points: &[[f64; 2]], motion: &PlanarMotion, others: &[Other]) -> f64 {
        score(self.scale.unsure, points, motion, others)
    }

    /// Some points with a motion, if it explains them and rest does not.
    fn with_motion(&self, sweep: usize, evident: Vec<[f64; 2]>, expected: &PlanarMotion) -> Option<Candidate> {
        let centre = middle(&evident);
        let motion = PlanarMotion { centre, velocity: expected.at(centre).0, ..*expected };
        let others = self.others(sweep);
        let score_of = |motion: &PlanarMotion| self.score(&evident, motion, &others);
        let (score, resting) = (score_of(&motion), score_of(&PlanarMotion::rest(centre)));
        let moves = is_motion(score, resting);
        moves.then(|| Candidate { sweep, evident, elsewhere: Vec::new(), motion, score, moves })
    }

    /// Some evident points with the motion that explains them best.
    fn searched(&self, sweep: usize, evident: Vec<[f64; 2]>) -> Candidate {
        let (motion, best, resting) = search(&evident, &self.others(sweep), self.scale.unsure, self.scale.bends);
        let moves = is_motion(best, resting) && motion.speed() >= SPEED_MIN;
        Candidate { sweep, evident, elsewhere: Vec::new(), motion, score: best, moves }
    }

    /// The bodies of one sweep. A group of points near a body belongs to it where the body's motion explains it nearly
    /// as well as its own or rest does.
    ///
    /// The flat side of a car that is seen without its ends fits any speed along itself; its back fits one.
    fn united(&self, sweep: usize, groups: Vec<Candidate>) -> Vec<Candidate> {
        let others = self.others(sweep);
        let (mut bodies, mut rest): (Vec<Candidate>, Vec<Candidate>) =
            groups.into_iter().partition(|group| group.moves);
        // The body with the most points first: its motion is the surest.
        bodies.sort_by_key(|body| std::cmp::Reverse(body.evident.len()));
        let mut body = 0;
        while body < bodies.len() {
            let motion = bodies[body].motion;
            let fits = |group: &Candidate| {
                let score = self.score(&group.evident, &motion, &others);
                score >= SCORE_MIN && score >= group.score - UNITE_LOSS
            };
            let joins = |list: &[Candidate], from: usize, body: &Candidate| {
                (from..list.len()).find(|at| gap(&list[*at].evident, &body.evident) <= UNITE_GAP && fits(&list[*at]))
            };
            if let Some(at) = joins(&bodies, body + 1, &bodies[body]) {
                let joined = bodies.remove(at);
                bodies[body].join(joined);
            } else if let Some(at) = joins(&rest, 0, &bodies[body]) {
                bodies[body].join(rest.remove(at));
            } else {
                body += 1;
            }
        }
        bodies
    }

    /// Bodies that the sweep before or after confirms, with those found there by following them.
    ///
    /// A body that drives away hides the places where it will be, so no ray shows that they were empty: it is evident
    /// in the first sweeps alone and is followed into the later ones.
    fn followed(&self, found: Vec<Candidate>) -> Vec<Candidate> {
        let mut bodies: Vec<(Candidate, bool)> = found.into_iter().map(|body| (body, false)).collect();
        bodies.sort_by_key(|(body, _)| std::cmp::Reverse(body.evident.len()));
        let mut next = 0;
        while next < bodies.len() {
            for (other, moved, hidden) in self.around(&bodies[next].0) {
                let expected = self.moved(&bodies[next].0, other);
                let footprint = Footprint::of(expected.velocity, moved.iter().copied());
                let confirms = |body: &Candidate| confirms(body, &expected, &footprint);
                let known = bodies.iter().position(|(body, _)| body.sweep == other && confirms(body));
                if let Some(known) = known {
                    (bodies[next].1, bodies[known].1) = (true, true);
                    if bodies[known].0.evident.len() < bodies[next].0.evident.len() {
                        self.adopt(&mut bodies[known].0, &expected);
                    }
                    // The other leads back here in its own turn.
                    bodies[known].0.elsewhere.extend(moved);
                    continue;
                }
                let points = self.near(other, &moved);
                if points.len() < self.scale.fewest {
                    continue;
                }
                let there = Some(self.searched(other, points.clone())).filter(|there| there.moves && confirms(there));
                // What is seen of a body that is mostly hidden is too little for a motion of its own.
                let follows = self.scale.follows || hidden;
                let as_expected = || follows.then(|| self.with_motion(other, points, &expected)).flatten();
                if let Some(mut there) = there.or_else(as_expected) {
                    self.adopt(&mut there, &expected);
                    there.elsewhere.extend(moved);
                    bodies[next].1 = true;
                    bodies.push((there, true));
                }
            }
            next += 1;
        }
        bodies.into_iter().filter(|(_, confirmed)| *confirmed).map(|(body, _)| body).collect()
    }

    /// Takes the motion of the same body in another sweep, where more of it is seen, if it explains the points nearly
    /// as well in all sweeps.
    fn adopt(&self, body: &mut Candidate, expected: &PlanarMotion) {
        let (velocity, _) = expected.at(body.motion.centre);
        let motion = PlanarMotion { centre: body.motion.centre, velocity, ..*expected };
        let others = self.others(body.sweep);
        let of_all = |motion: &PlanarMotion| score(0.0, &body.evident, motion, &others);
        if of_all(&motion) >= of_all(&body.motion) - ADOPT_LOSS {
            (body.motion, body.score) = (motion, self.score(&body.evident, &motion, &others));
        }
    }

    /// The sweeps next in time to that of a body, in both directions: those that see it, and as many that do not as lie
    /// between. With each, where the body's points are there and whether most of them are hidden.
    fn around(&self, body: &Candidate) -> Vec<(usize, Vec<[f64; 2]>, bool)> {
        let mut left = [self.scale.skipped + 1; 2];
        let mut around = Vec::new();
        for by in 1..self.sweeps.len() {
            for (other, left) in [body.sweep.wrapping_sub(by), body.sweep + by].into_iter().zip(&mut left) {
                if *left > 0 && other < self.sweeps.len() {
                    let moved = self.moved_points(body, other);
                    let hidden = self.shadows[other].hides_most(moved.iter().copied());
                    around.push((other, moved, hidden));
                    *left -= usize::from(!hidden);
                }
            }
        }
        around
    }

    /// The motion of a body at the time of another sweep.
    fn moved(&self, body: &Candidate, sweep: usize) -> PlanarMotion {
        let seconds = self.sweeps[sweep].time - self.sweeps[body.sweep].time;
        body.motion.after(seconds)
    }

    /// Where the evident points of a body are at the time of another sweep.
    fn moved_points(&self, body: &Candidate, sweep: usize) -> Vec<[f64; 2]> {
        let seconds = self.sweeps[sweep].time - self.sweeps[body.sweep].time;
        body.evident.iter().map(|point| body.motion.moved(*point, seconds)).collect()
    }

    /// The points of another sweep where the points of a body would be.
    fn near(&self, sweep: usize, moved: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let extent = Extent::of(moved.iter().copied());
        let plan = Plan::new(moved.iter().copied(), extent, self.scale.reach);
        places(&self.sweeps[sweep], &self.among[sweep]).filter(|[x, y]| plan.closeness(*x, *y) > 0.0).collect()
    }
}
