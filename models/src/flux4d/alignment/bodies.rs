//! Bodies of each sweep, their motions, and the points that belong to them.

use rayon::prelude::*;

use super::AlignedSweep;
use super::footprint::Footprint;
use super::free_space::RangeImage;
use super::ground::Ground;
use super::groups::{gap, joined};
use super::plan::{Extent, Plan};
use super::search::{Other, PlanarMotion, score, score_without, search};

/// Heights above the ground, metres, between which bodies are looked for: below is road and kerb, above are crowns of
/// trees and bridges.
const BODY_HEIGHTS: [f32; 2] = [0.3, 3.0];
/// Heights of the points that belong to a body once it is found: from its wheels to the roof of a lorry. The road
/// under a car is within 0.2 m of the ground around it.
const OWN_HEIGHTS: [f32; 2] = [0.15, 4.5];
/// Points nearer to the LiDAR than this, metres from above, may be on the ego vehicle: no evidence of a body, but points
/// of one that is found by others, as a car in the next lane.
const EGO_RADIUS: f64 = 3.0;
/// Points beyond this, metres, do not move: a car has a few points there.
const RANGE: f64 = 80.0;
/// Fewest evident points of a body: a person at 40 m has as many.
const POINTS_MIN: usize = 5;
/// Sweeps whose rays pass through a place before it is evident that something moved there; one for a snippet of three
/// sweeps or fewer.
const PASSES: usize = 2;
/// Edge of the cells of the plans, metres, and most of them along an axis.
const CELL: f64 = 0.1;
const CELLS_MAX: usize = 4096;
/// Room around the points, metres.
const PAD: f64 = 2.0;
/// A motion is believed whose score reaches the first and exceeds that of rest by the second.
const SCORE_MIN: f64 = 0.45;
const SCORE_GAIN: f64 = 0.2;
/// Slowest motion that is told from rest, metres per second: 0.3 m in a window of a second, less than the reach.
const SPEED_MIN: f64 = 0.4;
/// Room around a body's evident points in which points belong to it, metres.
const MARGIN: f64 = 0.35;
/// Room in which points belong to it that move rather than rest, along and across its motion, metres: what is evident of a
/// car may be its back alone.
const AROUND: [f64; 2] = [3.0, 1.5];
/// Closeness that a point must have to belong to a body, and what of it the point may lose against rest: the sides of a car
/// fit rest as well, a parked car beside it does better at rest.
const OWN_CLOSENESS: f64 = 0.3;
const OWN_LOSS: f64 = 0.1;
/// Bodies with a gap of at most the first (metres: the beams of a LiDAR graze the side of a car 1 m apart at 20 m) are one
/// body where that costs at most the second of the score.
const UNITE_GAP: f64 = 3.0;
const UNITE_LOSS: f64 = 0.1;
/// Score that a body may lose by the motion of the sweep that shows more of it.
const ADOPT_LOSS: f64 = 0.02;
/// Difference of velocities, metres per second and as a share, up to which a body of another sweep confirms one.
const CONFIRM: [f64; 2] = [1.0, 0.15];
/// Distance between the rectangle around a body's moved points and the points of the one that confirms it, metres: of two
/// sweeps the earlier shows the back of a car to have moved and the later its front.
const CONFIRM_DISTANCE: f64 = 2.5;

/// The motions of the points of all sweeps.
#[derive(Debug, Clone, Default)]
pub struct Aligned {
    /// The bodies that move, by sweep.
    pub bodies: Vec<Vec<PlanarMotion>>,
    /// The body of each point, by sweep; `None` rests.
    pub of_point: Vec<Vec<Option<u32>>>,
}

impl Aligned {
    /// Velocity and acceleration of a point of a sweep, metres and seconds; zero at rest.
    pub fn motion(&self, sweep: usize, point: usize, position: [f32; 3]) -> ([f64; 2], [f64; 2]) {
        let at = [0, 1].map(|axis| f64::from(position[axis]));
        self.of_point[sweep][point].map_or(([0.0; 2], [0.0; 2]), |body| self.bodies[sweep][body as usize].at(at))
    }
}

/// What all bodies are looked for in.
struct Snippet<'a> {
    sweeps: &'a [AlignedSweep<'a>],
    plans: Vec<Plan>,
    heights: Vec<Vec<f32>>,
}

/// A body of a sweep before its points are known.
#[derive(Clone)]
struct Candidate {
    sweep: usize,
    /// Evident points.
    evident: Vec<[f64; 2]>,
    /// Where the evident points of the same body in the sweeps before and after are at this one's time.
    elsewhere: Vec<[f64; 2]>,
    motion: PlanarMotion,
    /// How well the motion explains the points, 0 to 1.
    score: f64,
    /// Whether it does so better than rest.
    moves: bool,
}

impl Candidate {
    /// Takes the points of a group over; the motion stays, about the new middle.
    fn join(&mut self, group: Self) {
        self.evident.extend(group.evident);
        let middle = [0, 1].map(|axis| self.evident.iter().map(|p| p[axis]).sum::<f64>() / self.evident.len() as f64);
        let (velocity, _) = self.motion.at(middle);
        self.motion = PlanarMotion { centre: middle, velocity, ..self.motion };
    }
}

/// The motions of all points. Sweeps without points are left out. The same for any thread count.
pub fn align(sweeps: &[AlignedSweep]) -> Aligned {
    let ground = Ground::of(sweeps.iter().flat_map(|sweep| sweep.points));
    let heights: Vec<Vec<f32>> = sweeps.par_iter().map(|sweep| heights(sweep, &ground)).collect();
    let all = sweeps.iter().zip(&heights).flat_map(|(sweep, heights)| standing(sweep, heights));
    let extent = Extent::of(all, PAD, CELL, CELLS_MAX);
    let plans = sweeps.par_iter().zip(&heights).map(|(sweep, heights)| Plan::new(standing(sweep, heights), extent));
    let snippet = Snippet { sweeps, plans: plans.collect(), heights };
    let images: Vec<RangeImage> = sweeps.par_iter().map(RangeImage::new).collect();
    let candidates: Vec<(usize, Vec<[f64; 2]>)> =
        (0..sweeps.len()).flat_map(|sweep| snippet.evident(sweep, &images)).collect();
    let groups: Vec<Candidate> =
        candidates.into_par_iter().map(|(sweep, evident)| snippet.searched(sweep, evident)).collect();
    let bodies = (0..sweeps.len())
        .flat_map(|sweep| snippet.united(sweep, groups.iter().filter(|group| group.sweep == sweep).cloned().collect()));
    snippet.claimed(snippet.followed(bodies.collect()))
}

/// Heights above the ground; 0 beyond the range.
fn heights(sweep: &AlignedSweep, ground: &Ground) -> Vec<f32> {
    let height = |point| if distance(sweep, point) < RANGE { ground.above(point) } else { 0.0 };
    sweep.points.iter().map(height).collect()
}

/// Distance from the LiDAR as seen from above, metres.
fn distance(sweep: &AlignedSweep, point: &[f32; 3]) -> f64 {
    let [x, y, _] = sweep.origin;
    (f64::from(point[0]) - x).hypot(f64::from(point[1]) - y)
}

fn stands(height: f32) -> bool {
    (BODY_HEIGHTS[0]..BODY_HEIGHTS[1]).contains(&height)
}

/// The points of a sweep between which bodies are looked for, from above.
fn standing(sweep: &AlignedSweep<'_>, heights: &[f32]) -> impl Iterator<Item = [f64; 2]> {
    let points = sweep.points.iter().zip(heights);
    points.filter(|(_, height)| stands(**height)).map(|(point, _)| in_plan(point))
}

fn in_plan(point: &[f32; 3]) -> [f64; 2] {
    [0, 1].map(|axis| f64::from(point[axis]))
}

impl Snippet<'_> {
    /// The other sweeps as seen from one, the nearest in time first.
    fn others(&self, sweep: usize) -> Vec<Other<'_>> {
        let other =
            |index: usize| Other { plan: &self.plans[index], after: self.sweeps[index].time - self.sweeps[sweep].time };
        let mut others: Vec<Other> =
            (0..self.sweeps.len()).filter(|i| *i != sweep && !self.sweeps[*i].points.is_empty()).map(other).collect();
        others.sort_by(|a, b| a.after.abs().total_cmp(&b.after.abs()));
        others
    }

    /// Groups of points of a sweep through whose places rays of other sweeps passed.
    fn evident(&self, sweep: usize, images: &[RangeImage]) -> Vec<(usize, Vec<[f64; 2]>)> {
        let needed = if images.len() <= 3 { 1 } else { PASSES };
        let points = self.sweeps[sweep].points;
        let moved = |index: &usize| {
            let point = &points[*index];
            let others = images.iter().enumerate().filter(|(other, _)| *other != sweep);
            let passed = others.filter(|(_, image)| image.passed(point));
            passed.count() >= needed
        };
        let kept: Vec<usize> = (0..points.len())
            .into_par_iter()
            .filter(|index| stands(self.heights[sweep][*index]))
            .filter(|index| distance(&self.sweeps[sweep], &points[*index]) >= EGO_RADIUS)
            .filter(moved)
            .collect();
        let groups = joined(&kept.iter().map(|index| in_plan(&points[*index])).collect::<Vec<_>>());
        groups.into_iter().filter(|group| group.len() >= POINTS_MIN).map(|group| (sweep, group)).collect()
    }

    /// Some evident points with the motion that explains them best.
    fn searched(&self, sweep: usize, evident: Vec<[f64; 2]>) -> Candidate {
        let (motion, best, resting) = search(&evident, &self.others(sweep));
        let moves = best >= SCORE_MIN && best >= resting + SCORE_GAIN && motion.speed() >= SPEED_MIN;
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
                let score = score(&group.evident, &motion, &others);
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
    /// What drives away hides the places where it will be, so no ray shows that they were empty: such a body is evident in
    /// the first sweeps alone and is followed into the later ones.
    fn followed(&self, found: Vec<Candidate>) -> Vec<Candidate> {
        let mut bodies: Vec<(Candidate, bool)> = found.into_iter().map(|body| (body, false)).collect();
        bodies.sort_by_key(|(body, _)| std::cmp::Reverse(body.evident.len()));
        let mut next = 0;
        while next < bodies.len() {
            let sweep = bodies[next].0.sweep;
            for other in [sweep.wrapping_sub(1), sweep + 1].into_iter().filter(|other| *other < self.sweeps.len()) {
                let expected = self.moved(&bodies[next].0, other);
                let moved = self.moved_points(&bodies[next].0, other);
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
                let there =
                    (points.len() >= POINTS_MIN).then(|| self.searched(other, points)).filter(|there| there.moves);
                if let Some(mut there) = there.filter(confirms) {
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

    /// Takes the motion of the same body in another sweep, where more of it is seen, if it explains the points nearly as
    /// well in all sweeps.
    fn adopt(&self, body: &mut Candidate, expected: &PlanarMotion) {
        let (velocity, _) = expected.at(body.motion.centre);
        let motion = PlanarMotion { centre: body.motion.centre, velocity, ..*expected };
        let others = self.others(body.sweep);
        let of_all = |motion: &PlanarMotion| score_without(0.0, &body.evident, motion, &others);
        if of_all(&motion) >= of_all(&body.motion) - ADOPT_LOSS {
            (body.motion, body.score) = (motion, score(&body.evident, &motion, &others));
        }
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

    /// The standing points of another sweep where the points of a body would be.
    fn near(&self, sweep: usize, moved: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let plan = Plan::new(moved.iter().copied(), Extent::of(moved.iter().copied(), PAD, CELL, CELLS_MAX));
        let standing = standing(&self.sweeps[sweep], &self.heights[sweep]);
        standing.filter(|[x, y]| plan.closeness(*x, *y) > 0.0).collect()
    }

    /// Gives the points near each body to it.
    fn claimed(&self, bodies: Vec<Candidate>) -> Aligned {
        let of_sweep = |sweep: usize| {
            let own: Vec<&Candidate> = bodies.iter().filter(|body| body.sweep == sweep).collect();
            let footprint = |body: &&Candidate| {
                let points = body.evident.iter().chain(&body.elsewhere);
                Footprint::of(body.motion.velocity, points.copied())
            };
            let boxes: Vec<Footprint> = own.iter().map(footprint).collect();
            let others = self.others(sweep);
            let of_point = |index: usize| {
                let height = self.heights[sweep][index];
                if !(OWN_HEIGHTS[0]..OWN_HEIGHTS[1]).contains(&height) {
                    return None;
                }
                let at = in_plan(&self.sweeps[sweep].points[index]);
                let fit = |body: usize| {
                    let motion = &own[body].motion;
                    let moving = score(&[at], motion, &others);
                    let rest = score(&[at], &PlanarMotion::rest(motion.centre), &others);
                    let fits = if boxes[body].contains(at, [MARGIN; 2]) {
                        moving >= OWN_CLOSENESS && moving >= rest - OWN_LOSS
                    } else {
                        moving >= SCORE_MIN && moving >= rest + SCORE_GAIN
                    };
                    fits.then_some((moving, body))
                };
                let near = (0..own.len()).filter(|body| boxes[*body].contains(at, AROUND));
                near.filter_map(fit).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, body)| body as u32)
            };
            let of_point: Vec<Option<u32>> =
                (0..self.sweeps[sweep].points.len()).into_par_iter().map(of_point).collect();
            (own.iter().map(|body| body.motion).collect::<Vec<_>>(), of_point)
        };
        let (bodies, of_point) = (0..self.sweeps.len()).map(of_sweep).unzip();
        Aligned { bodies, of_point }
    }
}

/// Whether a body moves as a body followed from another sweep would, whose points would be in `footprint`.
fn confirms(body: &Candidate, expected: &PlanarMotion, footprint: &Footprint) -> bool {
    let difference = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    difference(body.motion.velocity, expected.velocity) <= CONFIRM[0] + CONFIRM[1] * expected.speed()
        && body.evident.iter().any(|point| footprint.contains(*point, [CONFIRM_DISTANCE; 2]))
}
