//! Bodies of each sweep and their motions.

use rayon::prelude::*;

use super::AlignedSweep;
use super::aligned::Aligned;
use super::candidate::{Candidate, SCORE_MIN, is_motion};
use super::clock::Clock;
use super::evidence::places;
use super::groups::{gap, joined, middle};
use super::plan::{Extent, Plan};
use super::search::{Other, PlanarMotion, score, search};
use super::shadow::Shadow;
use super::tracks::Track;

/// Slowest motion that is told from rest, metres per second: 0.3 m in a window of a second, less than the reach.
const SPEED_MIN: f64 = 0.4;
/// Bodies with a gap of at most the first (metres: the beams of a LiDAR graze the side of a car 1 m apart at 20 m) are
/// one body where that costs at most the second of the score.
pub const UNITE_GAP: f64 = 3.0;
pub const UNITE_LOSS: f64 = 0.1;

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
    /// Whether velocities may change.
    pub bends: bool,
}

/// Bodies with a surface. The reach is two steps of a spinning LiDAR at 50 m, and the change of the visible side of a
/// car between sweeps; a person at 40 m has five points.
pub const FINE: Scale = Scale { reach: 0.4, join: 0.3, fewest: 5, unsure: 0.34, bends: true };
/// Bodies of a few beams, which meet the bumper in one sweep and the window 1.4 m behind it in another. Their places
/// are too vague for a change of velocity.
pub const COARSE: Scale = Scale { reach: 1.2, join: 0.75, fewest: 3, unsure: 0.5, bends: false };

/// All sweeps, and what is known of each.
#[derive(Clone, Copy)]
pub struct Seen<'a> {
    /// All of them.
    pub sweeps: &'a [AlignedSweep<'a>],
    /// Extent of all points above the ground, metres.
    pub heights: &'a [Vec<f32>],
    /// When each looks where.
    pub clocks: &'a [Clock],
    /// The places that each does not see.
    pub shadows: &'a [Shadow],
}

/// The sweeps in which all bodies of a scale are looked for.
pub struct Snippet<'a> {
    /// The sweeps.
    pub seen: Seen<'a>,
    /// The scale at which bodies are looked for.
    pub scale: Scale,
    /// The points of each sweep between which bodies are looked for.
    pub among: &'a [Vec<usize>],
    /// Of these points.
    pub plans: Vec<Plan>,
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
    pub fn new(seen: Seen<'a>, (scale, extent): (Scale, Extent), among: &'a [Vec<usize>]) -> Self {
        let plan = |(sweep, among): (&AlignedSweep, &Vec<usize>)| Plan::new(places(sweep, among), extent, scale.reach);
        let plans = seen.sweeps.par_iter().zip(among).map(plan).collect();
        Self { seen, scale, among, plans, before: None }
    }

    /// The bodies whose evident points are given, and what belongs to them.
    pub fn bodies(&self, evident: &[Vec<usize>]) -> Aligned {
        let of_sweep = |sweep: usize| {
            let points: Vec<[f64; 2]> = places(&self.seen.sweeps[sweep], &evident[sweep]).collect();
            let groups = joined(&points, self.scale.join);
            groups.into_iter().filter(|group| group.len() >= self.scale.fewest).map(move |group| (sweep, group))
        };
        let groups: Vec<(usize, Vec<[f64; 2]>)> = (0..self.seen.sweeps.len()).flat_map(of_sweep).collect();
        let groups: Vec<Candidate> =
            groups.into_par_iter().map(|(sweep, evident)| self.searched(sweep, evident)).collect();
        let of_sweep = |sweep: usize| groups.iter().filter(move |group| group.sweep == sweep).cloned().collect();
        let bodies: Vec<Candidate> =
            (0..self.seen.sweeps.len()).flat_map(|sweep| self.united(sweep, of_sweep(sweep))).collect();
        self.claimed(self.tracks(bodies))
    }

    /// The other sweeps that show motion since one or until then, the nearest in time first.
    pub fn others(&self, sweep: usize) -> Vec<Other<'_>> {
        let Seen { sweeps, clocks, shadows, .. } = self.seen;
        let shows = |other: &usize| clocks[*other].is_apart(&clocks[sweep]) && !sweeps[*other].points.is_empty();
        let other = |index: usize| Other { plan: &self.plans[index], shadow: &shadows[index], clock: &clocks[index] };
        let mut others: Vec<Other> = (0..sweeps.len()).filter(shows).map(other).collect();
        let apart = |other: &Other| (other.clock.middle() - clocks[sweep].middle()).abs();
        others.sort_by(|a, b| apart(a).total_cmp(&apart(b)));
        others
    }

    /// How well a motion explains points of a sweep to the `others`, 0 to 1.
    pub fn score(&self, points: &[[f64; 2]], motion: &PlanarMotion, others: &[Other]) -> f64 {
        score(self.scale.unsure, points, motion, others)
    }

    /// Some evident points with the motion that explains them best.
    fn searched(&self, sweep: usize, evident: Vec<[f64; 2]>) -> Candidate {
        let time = self.seen.clocks[sweep].at(middle(&evident));
        let others = self.others(sweep);
        let (motion, best, resting) = search((time, &evident), &others, self.scale.unsure, self.scale.bends);
        let moves = is_motion(best, resting) && motion.speed() >= SPEED_MIN;
        Candidate { sweep, evident, motion, score: best, moves }
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
            let footprints = Track::of(motion, sweep, bodies[body].evident.clone()).footprints(self);
            let fits = |group: &Candidate| {
                let score = self.score(&group.evident, &motion, &others);
                score >= SCORE_MIN.max(group.score - UNITE_LOSS) && !self.rest_most(&group.evident, sweep, &footprints)
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
}
