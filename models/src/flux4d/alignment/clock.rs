//! When a sweep looks in a direction: a LiDAR that turns sees what is before it and what is behind it at two times.

use std::f64::consts::{PI, TAU};

use gs_base::median;

use super::{AlignedSweep, in_plan};

/// Directions of a turn, each with one time: 3 degrees, in which a LiDAR of ten turns a second takes 0.8 ms.
const DIRECTIONS: usize = 120;

/// Least time between two sweeps that say something about motion, seconds: in less than this, cars in a town move by
/// less than the reach, and two LiDARs differ by their places.
const PAIR_MIN: f64 = 0.06;

/// The times of a sweep.
#[derive(Debug)]
pub struct Clock {
    origin: [f64; 2],
    /// Seconds, by direction.
    times: Vec<f64>,
    /// The median time, seconds.
    middle: f64,
}

impl Clock {
    /// Of a sweep's points. A direction without points has the time of the next one with some; a sweep without points
    /// has time 0 and is seen by nobody.
    pub fn of(sweep: &AlignedSweep) -> Self {
        let origin = [sweep.origin[0], sweep.origin[1]];
        let mut by_direction = vec![Vec::new(); DIRECTIONS];
        for (point, time) in sweep.points.iter().zip(sweep.times) {
            by_direction[direction(origin, in_plan(point))].push(*time);
        }
        let known: Vec<Option<f64>> = by_direction.into_iter().map(median).collect();
        let near = |at: usize| {
            let both = |step: usize| [(at + step) % DIRECTIONS, (at + DIRECTIONS - step) % DIRECTIONS];
            (0..=DIRECTIONS / 2).flat_map(both).find_map(|place| known[place]).unwrap_or_default()
        };
        let times = (0..DIRECTIONS).map(near).collect();
        Self { origin, times, middle: median(sweep.times.to_vec()).unwrap_or_default() }
    }

    /// The median time of the sweep, seconds.
    pub fn middle(&self) -> f64 {
        self.middle
    }

    /// Whether another sweep is so much earlier or later that the two show motion.
    pub fn is_apart(&self, other: &Self) -> bool {
        (self.middle - other.middle).abs() >= PAIR_MIN
    }

    /// The time at which a place is looked at, seconds.
    pub fn at(&self, place: [f64; 2]) -> f64 {
        self.times[direction(self.origin, place)]
    }
}

fn direction(origin: [f64; 2], at: [f64; 2]) -> usize {
    let turn = ((at[1] - origin[1]).atan2(at[0] - origin[0]) + PI) / TAU;
    ((turn * DIRECTIONS as f64) as usize).min(DIRECTIONS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A turn from behind over 0.1 s that saw nothing on its right: what is ahead is seen half a turn later.
    #[test]
    fn each_direction_has_its_time() {
        let turn = |step: usize| (f64::from(step as u32) + 0.5) / 360.0;
        let steps: Vec<usize> = (90..360).collect();
        let point = |step: &usize| {
            let angle = turn(*step) * TAU - PI;
            [(3.0 + 9.0 * angle.cos()) as f32, (9.0 * angle.sin()) as f32, 0.0]
        };
        let points: Vec<[f32; 3]> = steps.iter().map(point).collect();
        let times: Vec<f64> = steps.iter().map(|step| 5.0 + 0.1 * turn(*step)).collect();
        let clock = Clock::of(&AlignedSweep { points: &points, times: &times, origin: [3.0, 0.0, 2.0] });
        // A direction is 3 degrees wide: 0.8 ms.
        assert!((clock.at([50.0, 0.0]) - 5.05).abs() < 1e-3, "{}", clock.at([50.0, 0.0]));
        assert!((clock.at([3.0, 1.0]) - 5.075).abs() < 1e-3, "{}", clock.at([3.0, 1.0]));
        // Nothing there: the time of the next direction with points.
        assert!((clock.at([-20.0, -1.0]) - 5.1).abs() < 2e-3, "{}", clock.at([-20.0, -1.0]));
        assert_eq!(Clock::of(&AlignedSweep { points: &[], times: &[], origin: [0.0; 3] }).at([1.0, 1.0]), 0.0);
    }
}
