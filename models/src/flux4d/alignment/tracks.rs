//! Bodies over all sweeps: one motion each, judged by all sweeps that show it.
//!
//! A body that drives away hides the places where it will be, so no ray shows that they were empty: it is evident in
//! the first sweeps alone. The side of a slow car explains rest as well as motion in most sweeps. Both are carried from
//! the sweeps in which they are evident to all others.

use super::candidate::{Candidate, SCORE_MIN, UNITE_GAP, UNITE_LOSS, confirms};
use super::evidence::places;
use super::footprint::Footprint;
use super::groups::middle;
use super::plan::{Extent, Plan};
use super::search::{Other, PlanarMotion, refine, thinned};
use super::sweeps::Snippet;

/// Points of a body in a sweep by which its motion is judged.
const POINTS: usize = 64;
/// Score that points of another sweep may lose by a body's motion against rest: the side of a car fits both.
const CARRY_LOSS: f64 = 0.1;
/// Least gain of closeness by a motion, in the mean over points and sweeps: a car of 2 m/s has 0.13 in half a second.
const GAIN_MIN: f64 = 0.06;
/// Share of the differences of closeness that must be for the motion: of what rests, the changing visible part and the
/// noise of beams are for a motion and against it alike. Two sweeps agree more easily by chance.
const SURE: f64 = 0.8;
const SURE_OF_TWO: f64 = 0.95;
/// A place is a surface at rest that is seen, while a body is elsewhere, in this share of the sweeps, or in as many
/// sweeps as the second. Closenesses are summed, which are 1 at a point.
const REST_SHARE: f32 = 0.6;
const REST_SWEEPS: f32 = 1.5;
/// Room around the evident points of a body in which it may be, metres along and across: its back alone may be evident.
const ELSEWHERE: [f64; 2] = [1.0, 0.35];
/// Room along and across the motion of a body in which its other end may be, metres: of a car that passes, both ends
/// are evident and the side between them fits rest.
const ENDS: [f64; 2] = [5.0, 0.35];
/// Score that a body in line with another may lose by the other's motion, if it is a part of it.
const INSIDE_LOSS: f64 = 0.3;
/// Steps of the search for the motion in all sweeps together: metres and seconds, radians a second.
const STEPS: [f64; 4] = [0.25, 0.25, 0.5, 0.1];

/// The points of a body in a sweep.
struct Member {
    sweep: usize,
    points: Vec<[f64; 2]>,
    /// Whether they are evident by themselves, or carried there by the motion.
    evident: bool,
}

/// Some of the points of a member, and the sweeps by which a motion of them is judged.
struct Sighting<'a> {
    sweep: usize,
    points: Vec<[f64; 2]>,
    others: Vec<Other<'a>>,
}

/// A body over all sweeps.
pub struct Track {
    /// About any time.
    motion: PlanarMotion,
    /// One for each sweep that shows it. Its extent is that of its evident points, so that it does not grow into its
    /// surroundings from sweep to sweep.
    members: Vec<Member>,
}

impl Track {
    /// Of a body that one sweep shows.
    pub fn of(motion: PlanarMotion, sweep: usize, points: Vec<[f64; 2]>) -> Self {
        Self { motion, members: vec![Member { sweep, points, evident: true }] }
    }

    /// The motion about the time at which a sweep sees the body.
    pub fn at(&self, snippet: &Snippet, sweep: usize) -> PlanarMotion {
        snippet.at(&self.motion, sweep)
    }

    /// The ground that it covers when each sweep sees it.
    pub fn footprints(&self, snippet: &Snippet) -> Vec<Footprint> {
        let of = |sweep| Footprint::of(self.at(snippet, sweep).velocity, self.points(snippet, sweep).into_iter());
        (0..snippet.seen.sweeps.len()).map(of).collect()
    }

    /// Where its evident points are when a sweep sees it.
    fn points(&self, snippet: &Snippet, sweep: usize) -> Vec<[f64; 2]> {
        let to = self.at(snippet, sweep).time;
        let moved = |member: &Member| {
            let motion = self.at(snippet, member.sweep);
            member.points.iter().map(|point| motion.moved(*point, to - motion.time)).collect::<Vec<_>>()
        };
        self.members.iter().filter(|member| member.evident).flat_map(moved).collect()
    }

    /// Adds points of a sweep. Evident ones replace those that were carried there, which say no more.
    fn add(&mut self, new: Member) {
        match self.members.iter_mut().find(|member| member.sweep == new.sweep) {
            _ if new.points.is_empty() => {}
            None => self.members.push(new),
            Some(member) if member.evident == new.evident => member.points.extend(new.points),
            Some(member) if new.evident => *member = new,
            Some(_) => {}
        }
    }

    fn len(&self) -> usize {
        self.members.iter().map(|member| member.points.len()).sum()
    }
}

/// Candidates, whether each is no part of a body yet, and the ground of the bodies so far.
struct Left {
    candidates: Vec<Candidate>,
    free: Vec<bool>,
    taken: Vec<Vec<Footprint>>,
}

impl Snippet<'_> {
    /// The bodies of all sweeps, those with the most points first.
    pub fn tracks(&self, mut candidates: Vec<Candidate>) -> Vec<Track> {
        candidates.sort_by_key(|body| std::cmp::Reverse(body.evident.len()));
        let mut left = Left { free: vec![true; candidates.len()], candidates, taken: Vec::new() };
        let mut tracks = Vec::new();
        for next in 0..left.candidates.len() {
            if !left.free[next] {
                continue;
            }
            let before = left.free.clone();
            left.free[next] = false;
            let first = &left.candidates[next];
            let mut track = Track::of(first.motion, first.sweep, first.evident.clone());
            let motions = self.gather(&mut track, &mut left);
            self.settle(&mut track, motions);
            // By the motion of all sweeps it may be met in more of them.
            self.gather(&mut track, &mut left);
            if self.moves(&track) {
                left.taken.push(track.footprints(self));
                tracks.push(track);
            } else {
                left.free = before;
                left.free[next] = false;
            }
        }
        self.merged(tracks)
    }

    /// A motion about the time at which a sweep sees the body.
    fn at(&self, motion: &PlanarMotion, sweep: usize) -> PlanarMotion {
        motion.after(motion.until(&self.seen.clocks[sweep]))
    }

    /// Adds what the sweeps show of a body, the nearest in time first: candidates that move like it, whose motions are
    /// returned, candidates that its motion explains as well as their own does, or points that its motion explains.
    fn gather(&self, track: &mut Track, left: &mut Left) -> Vec<PlanarMotion> {
        let seen = self.seen;
        let mut sweeps: Vec<usize> = (0..seen.sweeps.len()).filter(|s| !seen.sweeps[*s].points.is_empty()).collect();
        let apart = |sweep: &usize| (seen.clocks[*sweep].middle() - track.motion.time).abs();
        sweeps.sort_by(|a, b| apart(a).total_cmp(&apart(b)));
        let (mut motions, mut footprints) = (Vec::new(), track.footprints(self));
        for sweep in sweeps {
            let (expected, others) = (track.at(self, sweep), self.others(sweep));
            let explains = |body: &Candidate| {
                let is_near = body.evident.iter().any(|point| footprints[sweep].contains(*point, [UNITE_GAP; 2]));
                let score = || self.score(&body.evident, &expected, &others);
                let fits = is_near && score() >= SCORE_MIN.max(body.score - UNITE_LOSS);
                fits && !self.rest_most(&body.evident, sweep, &footprints)
            };
            let mut own = Vec::new();
            for (body, free) in left.candidates.iter().zip(&mut left.free) {
                if !*free || body.sweep != sweep {
                    continue;
                }
                let confirms = confirms(body, &expected, &footprints[sweep]);
                if confirms || explains(body) {
                    motions.extend(confirms.then_some(body.motion));
                    own.extend(body.evident.iter().copied());
                    *free = false;
                }
            }
            if !own.is_empty() {
                track.add(Member { sweep, points: own, evident: true });
                footprints = track.footprints(self);
            } else if track.members.iter().all(|member| member.sweep != sweep) {
                let points = self.carried(track, sweep, &footprints, &left.taken);
                track.add(Member { sweep, points, evident: false });
            }
        }
        motions
    }

    /// The points of a sweep where those of a body would be, if its motion explains them; else none. Surfaces at rest
    /// and points of other bodies are left out: what a body uncovers behind it moves with its shadow, and led back in
    /// time it would be the body itself.
    fn carried(
        &self,
        track: &Track,
        sweep: usize,
        footprints: &[Footprint],
        taken: &[Vec<Footprint>],
    ) -> Vec<[f64; 2]> {
        let (expected, moved) = (track.at(self, sweep), track.points(self, sweep));
        let plan = Plan::new(moved.iter().copied(), Extent::of(moved.iter().copied()), self.scale.reach);
        let is_free =
            |point: &&usize| self.before.as_ref().is_none_or(|before| before.found.of_point[sweep][**point].is_none());
        let free: Vec<usize> = self.among[sweep].iter().filter(is_free).copied().collect();
        let is_own = |at: &[f64; 2]| {
            plan.closeness(at[0], at[1]) > 0.0
                && !taken.iter().any(|body| body[sweep].contains(*at, [0.0; 2]))
                && !self.rests(*at, sweep, footprints)
        };
        let near: Vec<[f64; 2]> = places(&self.seen.sweeps[sweep], &free).filter(is_own).collect();
        if near.len() < self.scale.fewest {
            return Vec::new();
        }
        let others = self.others(sweep);
        let score = |motion: &PlanarMotion| self.score(&near, motion, &others);
        let (moving, resting) = (score(&expected), score(&PlanarMotion::rest(expected.time, middle(&near))));
        if moving >= SCORE_MIN.max(resting - CARRY_LOSS) { near } else { Vec::new() }
    }

    /// Whether a place of a sweep is a surface at rest: sweeps show it while the body, whose `footprints` are given, is
    /// elsewhere.
    pub fn rests(&self, at: [f64; 2], sweep: usize, footprints: &[Footprint]) -> bool {
        let seen = self.seen;
        let is_elsewhere = |other: &usize| {
            seen.clocks[*other].is_apart(&seen.clocks[sweep])
                && !footprints[*other].contains(at, ELSEWHERE)
                && !seen.shadows[*other].hides(at)
        };
        let (mut sum, mut count) = (0.0, 0.0);
        for other in (0..seen.sweeps.len()).filter(is_elsewhere) {
            let weight = seen.weights[other];
            (sum, count) = (sum + weight * self.plans[other].closeness(at[0], at[1]), count + weight);
        }
        count > 0.0 && sum >= (REST_SHARE * count).min(REST_SWEEPS)
    }

    /// Whether most of some points of a sweep are on surfaces at rest.
    pub fn rest_most(&self, points: &[[f64; 2]], sweep: usize, footprints: &[Footprint]) -> bool {
        2 * points.iter().filter(|at| self.rests(**at, sweep, footprints)).count() > points.len()
    }

    /// Gives a body the motion that explains all its members best, from its own and those of the members.
    fn settle(&self, track: &mut Track, motions: Vec<PlanarMotion>) {
        let sightings = self.sightings(track);
        let value = |_: &[[f64; 2]], motion: &PlanarMotion| self.value(&sightings, motion);
        let time = track.motion.time;
        let from = motions.into_iter().map(|motion| motion.after(time - motion.time)).chain([track.motion]);
        let best = from.max_by(|a, b| value(&[], a).total_cmp(&value(&[], b))).unwrap_or(track.motion);
        let steps = if self.scale.bends { STEPS } else { [STEPS[0], STEPS[1], 0.0, 0.0] };
        track.motion = refine(&[], best, steps, &value).0;
    }

    /// The members of a body as its motion is judged by them.
    fn sightings(&self, track: &Track) -> Vec<Sighting<'_>> {
        let of_member = |Member { sweep, points, .. }: &Member| Sighting {
            sweep: *sweep,
            points: thinned(points, POINTS),
            others: self.others(*sweep),
        };
        track.members.iter().map(of_member).collect()
    }

    /// How well a motion explains the points of all sightings, 0 to 1.
    fn value(&self, sightings: &[Sighting], motion: &PlanarMotion) -> f64 {
        let of_sighting = |seen: &Sighting| self.score(&seen.points, &self.at(motion, seen.sweep), &seen.others);
        sightings.iter().map(of_sighting).sum::<f64>() / sightings.len() as f64
    }

    /// The bodies without those that are parts of one with more points.
    fn merged(&self, mut tracks: Vec<Track>) -> Vec<Track> {
        tracks.sort_by_key(|track| std::cmp::Reverse(track.len()));
        let mut kept: Vec<(Track, Vec<Footprint>)> = Vec::new();
        for track in tracks {
            match kept.iter_mut().find(|(body, footprints)| self.is_part(&track, body, footprints)) {
                None => {
                    let footprints = track.footprints(self);
                    kept.push((track, footprints));
                }
                Some((body, footprints)) => {
                    track.members.into_iter().for_each(|member| body.add(member));
                    *footprints = body.footprints(self);
                }
            }
        }
        kept.into_iter().map(|(body, _)| body).collect()
    }

    /// Whether a body is a part of another, whose motion explains it nearly as well as its own does; with more loss if
    /// most of it is in line with the other. The side of a car that is seen without its ends fits any speed along
    /// itself.
    fn is_part(&self, track: &Track, body: &Track, footprints: &[Footprint]) -> bool {
        let within = |room: [f64; 2]| {
            let of_member = |Member { sweep, points, .. }: &Member| {
                points.iter().filter(|point| footprints[*sweep].contains(**point, room)).count()
            };
            track.members.iter().map(of_member).sum::<usize>()
        };
        if within([UNITE_GAP; 2]) + within(ENDS) == 0 {
            return false;
        }
        let sightings = self.sightings(track);
        let score = self.value(&sightings, &body.motion);
        let loss = if 2 * within(ENDS) > track.len() { INSIDE_LOSS } else { UNITE_LOSS };
        score >= SCORE_MIN.max(self.value(&sightings, &track.motion) - loss)
    }

    /// Whether the sweeps together show motion rather than rest, by the places where the two differ.
    fn moves(&self, track: &Track) -> bool {
        let [gain, loss] = self.evidence(track);
        let share = if track.members.len() > 2 { SURE } else { SURE_OF_TWO };
        let clocks = self.seen.clocks;
        let first = &clocks[track.members[0].sweep];
        let is_apart = track.members.iter().any(|member| clocks[member.sweep].is_apart(first));
        is_apart && gain >= GAIN_MIN && gain - loss >= share * (gain + loss)
    }

    /// How much closer the motion brings the points to those of other sweeps than rest does, and how much closer rest
    /// does, in the mean over points and sweeps.
    fn evidence(&self, track: &Track) -> [f64; 2] {
        let (mut gain, mut loss, mut pairs) = (0.0, 0.0, 0);
        for Sighting { sweep, points, others } in self.sightings(track) {
            let motion = track.at(self, sweep);
            for other in &others {
                let after = motion.until(other.clock);
                for point in &points {
                    let [x, y] = motion.moved(*point, after);
                    let more = other.plan.closeness(x, y) - other.plan.closeness(point[0], point[1]);
                    (gain, loss) = (gain + f64::from(more.max(0.0)), loss + f64::from((-more).max(0.0)));
                }
                pairs += points.len();
            }
        }
        [gain, loss].map(|sum| sum / pairs.max(1) as f64)
    }
}
