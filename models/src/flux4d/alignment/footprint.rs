//! The ground that a body covers.

use crate::flux4d::far::extremes;

/// A rectangle along a motion around points.
pub struct Footprint {
    along: [f64; 2],
    low: [f64; 2],
    high: [f64; 2],
}

impl Footprint {
    /// Around points, along a velocity.
    pub fn of(velocity: [f64; 2], points: impl Iterator<Item = [f64; 2]>) -> Self {
        let speed = velocity[0].hypot(velocity[1]);
        let along = if speed > 0.0 { velocity.map(|x| x / speed) } else { [1.0, 0.0] };
        let [low, high] = extremes(points.map(|point| local(along, point)));
        Self { along, low, high }
    }

    /// Whether a point is in it, with some room along and across the motion, metres.
    pub fn contains(&self, point: [f64; 2], room: [f64; 2]) -> bool {
        let local = local(self.along, point);
        (0..2).all(|axis| (self.low[axis] - room[axis]..=self.high[axis] + room[axis]).contains(&local[axis]))
    }
}

/// Along a direction, and across it.
fn local([c, s]: [f64; 2], [x, y]: [f64; 2]) -> [f64; 2] {
    [c * x + s * y, c * y - s * x]
}
