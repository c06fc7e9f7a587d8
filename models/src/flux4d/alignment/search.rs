//! The motion that brings a body's points onto the points of the other sweeps.

use super::clock::Clock;
use super::groups::middle;
use super::plan::Plan;
use super::shadow::Shadow;
use crate::flux4d::far::extremes;

/// Fastest motion that is looked for, metres per second: 144 km/h.
const SPEED_MAX: f64 = 40.0;
/// Largest change of speed, metres per second squared: an emergency stop.
const ACCELERATION_MAX: f64 = 9.0;
/// Fastest turn, radians per second: a car in a crossing does half of it.
const TURN_MAX: f64 = 1.5;
/// Points of a body that the coarse search looks at, and the fine one.
const COARSE_POINTS: usize = 40;
const FINE_POINTS: usize = 120;
/// Coarse motions that are looked at more closely, and of these the ones that are refined in all sweeps.
const CANDIDATES: usize = 16;
const FINALISTS: usize = 3;
/// Sweeps that count in any case: one can be met by any motion.
const COUNTED: usize = 2;
/// Most steps of the grid of velocities to each side: those for sweeps a second apart. The grid's size grows by the
/// square of the time between sweeps, so that twenty seconds would take gigabytes.
const SIDE_MAX: f64 = 200.0;
/// Score that a metre per second costs: of equal alignments the slowest is meant.
const SPEED_COST: f64 = 0.002;
/// Gain of the score from which on an acceleration and a turn are believed.
const BEND_GAIN: f64 = 0.02;
/// First values of the search for them, metres per second squared and radians per second.
const ACCELERATIONS: [f64; 7] = [0.0, -6.0, -4.0, -2.0, 2.0, 4.0, 6.0];
const TURNS: [f64; 5] = [0.0, -0.5, -0.25, 0.25, 0.5];
/// Length from which on a body's turn can be seen, metres.
const TURN_LENGTH: f64 = 2.0;

/// Horizontal motion of a rigid body about a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlanarMotion {
    /// That time, seconds.
    pub time: f64,
    /// Position of the body's middle at that time, metres.
    pub centre: [f64; 2],
    /// Velocity of the middle, metres per second.
    pub velocity: [f64; 2],
    /// Along the velocity, metres per second squared.
    pub acceleration: f64,
    /// Counter-clockwise from above, radians per second.
    pub turn: f64,
}

impl PlanarMotion {
    /// No motion of a body that is seen at a time.
    pub fn rest(time: f64, centre: [f64; 2]) -> Self {
        Self { time, centre, velocity: [0.0; 2], acceleration: 0.0, turn: 0.0 }
    }

    /// Metres per second.
    pub fn speed(&self) -> f64 {
        let [x, y] = self.velocity;
        (x * x + y * y).sqrt()
    }

    /// Velocity and acceleration of the body at a position, metres and seconds.
    pub fn at(&self, position: [f64; 2]) -> ([f64; 2], [f64; 2]) {
        self.at_arm(position, self.central_acceleration())
    }

    /// Acceleration of the body's middle, metres per second squared.
    fn central_acceleration(&self) -> [f64; 2] {
        let ([vx, vy], speed) = (self.velocity, self.speed());
        let along = if speed > 0.0 { self.acceleration / speed } else { 0.0 };
        [along * vx - self.turn * vy, along * vy + self.turn * vx]
    }

    /// [`at`](Self::at) with the acceleration of the middle, which is the same for all positions.
    fn at_arm(&self, position: [f64; 2], [ax, ay]: [f64; 2]) -> ([f64; 2], [f64; 2]) {
        let [vx, vy] = self.velocity;
        let arm = [position[0] - self.centre[0], position[1] - self.centre[1]];
        let velocity = [vx - self.turn * arm[1], vy + self.turn * arm[0]];
        let squared = self.turn * self.turn;
        (velocity, [ax - squared * arm[0], ay - squared * arm[1]])
    }

    /// The same motion about a later time, its acceleration unchanged along the velocity.
    pub fn after(&self, seconds: f64) -> Self {
        let (velocity, acceleration) = self.at(self.centre);
        let velocity = [0, 1].map(|axis| velocity[axis] + seconds * acceleration[axis]);
        Self { time: self.time + seconds, centre: self.moved(self.centre, seconds), velocity, ..*self }
    }

    /// Seconds from the time that the motion is about until a sweep with this clock sees the body.
    pub fn until(&self, clock: &Clock) -> f64 {
        clock.at(self.moved(self.centre, clock.middle() - self.time)) - self.time
    }

    /// The position after `seconds` of the part of the body that is at a position now.
    pub fn moved(&self, position: [f64; 2], seconds: f64) -> [f64; 2] {
        self.mover(seconds)(position)
    }

    /// [`moved`](Self::moved) for many positions.
    fn mover(&self, seconds: f64) -> impl Fn([f64; 2]) -> [f64; 2] {
        let central = self.central_acceleration();
        move |position| {
            let (velocity, acceleration) = self.at_arm(position, central);
            [0, 1].map(|axis| position[axis] + seconds * (velocity[axis] + 0.5 * seconds * acceleration[axis]))
        }
    }
}

/// Another sweep as a body sees it.
#[derive(Clone, Copy)]
pub struct Other<'a> {
    /// Its points from above.
    pub plan: &'a Plan,
    /// The places that it does not see.
    pub shadow: &'a Shadow,
    /// When it looks where.
    pub clock: &'a Clock,
}

impl Other<'_> {
    /// Mean closeness of points that move, 0 to 1; `None` where most of them would be hidden and are not met.
    fn closeness(&self, points: &[[f64; 2]], motion: &PlanarMotion) -> Option<f64> {
        let (mut sum, mut hidden) = (0.0, 0);
        let moved = motion.mover(motion.until(self.clock));
        for point in points {
            let at = moved(*point);
            let close = self.plan.closeness(at[0], at[1]);
            sum += f64::from(close);
            hidden += usize::from(close == 0.0 && self.shadow.hides(at));
        }
        (2 * hidden <= points.len()).then_some(sum / points.len().max(1) as f64)
    }
}

/// Mean closeness of points that move to the points of the other sweeps, 0 to 1, without the sweeps in which the points
/// are hidden, and without the share `unsure` of all sweeps, the worst ones, of which those are a part.
pub fn score(unsure: f64, points: &[[f64; 2]], motion: &PlanarMotion, others: &[Other]) -> f64 {
    let counted = others.len() - (unsure * others.len() as f64) as usize;
    let mut scores: Vec<f64> = others.iter().filter_map(|other| other.closeness(points, motion)).collect();
    scores.sort_by(|a, b| b.total_cmp(a));
    scores.truncate(counted.max(COUNTED));
    let seen = scores.len().max(COUNTED.min(others.len()));
    scores.iter().sum::<f64>() / seen.max(1) as f64
}

/// The best motion of a body that is seen at a time, with its score, and the score of rest. Others are in the order of
/// their distance in time; the share `unsure` of them does not count. `bends`: whether the velocity may change.
pub fn search(
    (time, body): (f64, &[[f64; 2]]),
    others: &[Other],
    unsure: f64,
    bends: bool,
) -> (PlanarMotion, f64, f64) {
    let points = thinned(body, FINE_POINTS);
    let rest = PlanarMotion::rest(time, middle(body));
    let resting = score(unsure, &points, &rest, others);
    let penalised = |points: &[[f64; 2]], motion: &PlanarMotion, others: &[Other]| {
        score(unsure, points, motion, others) - SPEED_COST * motion.speed()
    };
    let near = &others[..others.len().min(2)];
    let mut found =
        coarse(&thinned(body, COARSE_POINTS), &rest, near, &|points, motion| penalised(points, motion, near));
    let middle = &others[..others.len().min(3)];
    let velocity_alone = [0.5, 0.5, 0.0, 0.0];
    for candidate in &mut found {
        *candidate = refine(&points, candidate.0, velocity_alone, &|points, motion| penalised(points, motion, middle));
    }
    found.sort_by(|a, b| b.1.total_cmp(&a.1));
    found.truncate(FINALISTS);
    let of_all = |points: &[[f64; 2]], motion: &PlanarMotion| penalised(points, motion, others);
    let fine = found.iter().map(|(motion, _)| refine(&points, *motion, [0.25, 0.25, 0.0, 0.0], &of_all));
    let best = fine.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((rest, resting));
    if !bends {
        return (best.0, best.1, resting);
    }
    let motion = bent(&points, best.0, others, extent(body) >= TURN_LENGTH);
    (motion, of_all(&points, &motion).max(best.1), resting)
}

/// A motion with the acceleration and turn that the sweeps farthest in time show, or as it was where they show none.
///
/// Here all sweeps count: by leaving out the worst, a body that brakes would be one that is hidden in the far sweeps.
fn bent(points: &[[f64; 2]], motion: PlanarMotion, others: &[Other], turns: bool) -> PlanarMotion {
    let of_all =
        |points: &[[f64; 2]], motion: &PlanarMotion| score(0.0, points, motion, others) - SPEED_COST * motion.speed();
    let straight = of_all(points, &motion);
    let turns: &[f64] = if turns { &TURNS } else { &[0.0] };
    let tried = ACCELERATIONS.iter().flat_map(|acceleration| {
        turns.iter().map(move |turn| PlanarMotion { acceleration: *acceleration, turn: *turn, ..motion })
    });
    let Some(from) = tried.max_by(|a, b| of_all(points, a).total_cmp(&of_all(points, b))) else { return motion };
    let turn = if turns.len() > 1 { 0.1 } else { 0.0 };
    let (found, value) = refine(points, from, [0.25, 0.25, 0.5, turn], &of_all);
    if value >= straight + BEND_GAIN { found } else { motion }
}

pub fn extent(points: &[[f64; 2]]) -> f64 {
    let [low, high] = extremes(points.iter().copied());
    (high[0] - low[0]).hypot(high[1] - low[1])
}

/// At most `most` points, evenly of the list.
pub fn thinned(points: &[[f64; 2]], most: usize) -> Vec<[f64; 2]> {
    points.iter().step_by(points.len().div_ceil(most).max(1)).copied().collect()
}

/// The best velocities of a grid, by the sweeps nearest in time.
fn coarse(points: &[[f64; 2]], rest: &PlanarMotion, near: &[Other], value_of: Value) -> Vec<(PlanarMotion, f64)> {
    // A step moves the points by half the reach in the sweep next in time.
    let Some(next) = near.first() else { return Vec::new() };
    let step =
        (0.5 * next.plan.reach() / rest.until(next.clock).abs().max(1e-3)).clamp(SPEED_MAX / SIDE_MAX, SPEED_MAX);
    let side = (SPEED_MAX / step) as i32;
    let mut scores = Vec::new();
    for row in -side..=side {
        for column in -side..=side {
            let velocity = [f64::from(column) * step, f64::from(row) * step];
            let motion = PlanarMotion { velocity, ..*rest };
            if motion.speed() <= SPEED_MAX {
                scores.push((motion, value_of(points, &motion)));
            }
        }
    }
    scores.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut kept: Vec<(PlanarMotion, f64)> = Vec::new();
    for (motion, value) in scores {
        let apart = |(other, _): &(PlanarMotion, f64)| {
            let [dx, dy] = [0, 1].map(|axis| motion.velocity[axis] - other.velocity[axis]);
            dx.hypot(dy) >= 1.5 * step
        };
        if kept.iter().all(apart) {
            kept.push((motion, value));
        }
        if kept.len() == CANDIDATES {
            break;
        }
    }
    kept
}

/// The value of points and a motion that is to become large.
pub type Value<'a> = &'a dyn Fn(&[[f64; 2]], &PlanarMotion) -> f64;

/// Compass search from a motion: the parameters (velocity, acceleration, turn) change by `steps`, which are halved four
/// times. A parameter with the step 0 stays.
pub fn refine(points: &[[f64; 2]], from: PlanarMotion, steps: [f64; 4], value_of: Value) -> (PlanarMotion, f64) {
    let (mut best, mut value) = (from, value_of(points, &from));
    for halving in 0..4 {
        // A round that gains nothing ends the size; no size needs more rounds than the grid's step has of its steps.
        for _ in 0..8 {
            let before = value;
            for (parameter, step) in steps.iter().enumerate() {
                for sign in [-1.0, 1.0] {
                    let tried = changed(&best, parameter, sign * step * 0.5f64.powi(halving));
                    let reached = if *step > 0.0 { value_of(points, &tried) } else { value };
                    if reached > value {
                        (best, value) = (tried, reached);
                    }
                }
            }
            if value <= before {
                break;
            }
        }
    }
    (best, value)
}

fn changed(motion: &PlanarMotion, parameter: usize, by: f64) -> PlanarMotion {
    let mut changed = *motion;
    match parameter {
        0 | 1 => changed.velocity[parameter] += by,
        2 => changed.acceleration = (changed.acceleration + by).clamp(-ACCELERATION_MAX, ACCELERATION_MAX),
        _ => changed.turn = (changed.turn + by).clamp(-TURN_MAX, TURN_MAX),
    }
    changed
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::super::AlignedSweep;
    use super::super::free_space::RangeImage;
    use super::super::ground::Ground;
    use super::super::plan::Extent;
    use super::*;

    /// Of sweeps a second apart or less the step is half the reach; of sweeps farther apart the grid does not grow.
    #[test]
    fn the_grid_is_bounded_by_the_time_between_sweeps() {
        let points = [[10.0_f32, 0.0, 1.0], [12.0, 1.0, 1.0]];
        let places = [[10.0, 0.0], [12.0, 1.0]];
        let (extent, ground) = (Extent::of(places.into_iter()), Ground::of(&[&points]));
        let sweep = AlignedSweep { points: &points, times: &[0.0; 2], origin: [0.0; 3] };
        let shadow = Shadow::new(&RangeImage::new(&sweep, |_| true), extent, &ground);
        let plan = Plan::new(places.into_iter(), extent, 0.4);
        let looked_at = |after: f64| {
            let later = AlignedSweep { times: &[after; 2], ..sweep };
            let clock = Clock::of(&later);
            let (calls, others) = (Cell::new(0_usize), [Other { plan: &plan, shadow: &shadow, clock: &clock }]);
            let value = |_: &[[f64; 2]], _: &PlanarMotion| {
                calls.set(calls.get() + 1);
                0.0
            };
            coarse(&places, &PlanarMotion::rest(0.0, [11.0, 0.5]), &others, &value);
            calls.get() as f64
        };
        // A disk of radius SPEED_MAX in steps of half the reach over the time between sweeps.
        let disk = |seconds: f64| std::f64::consts::PI * (SPEED_MAX * seconds / 0.2).powi(2);
        for (after, seconds) in [(0.5, 0.5), (1.0, 1.0), (20.0, 1.0), (1.7e9, 1.0)] {
            let share = looked_at(after) / disk(seconds);
            assert!((share - 1.0).abs() < 0.02, "{after} s: {share} of the disk");
        }
    }
}
