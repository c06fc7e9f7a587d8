//! Bodies of each sweep and their motions.

use rayon::prelude::*;

use super::aligned::Aligned;
use super::candidate::{Candidate, SCORE_MIN, UNITE_GAP, UNITE_LOSS, is_motion};
use super::evidence::places;
use super::groups::{gap, joined, middle};
use super::search::search;
use super::sweeps::Snippet;
use super::tracks::Track;

/// Slowest motion that is told from rest, metres per second: 0.3 m in a window of a second, less than the reach.
const SPEED_MIN: f64 = 0.4;

impl Snippet<'_> {
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
