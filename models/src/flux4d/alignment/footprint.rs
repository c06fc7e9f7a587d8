//! The ground that a body covers.

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
        let mut footprint = Self { along, low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] };
        for point in points {
            let local = footprint.local(point);
            for axis in 0..2 {
                footprint.low[axis] = footprint.low[axis].min(local[axis]);
                footprint.high[axis] = footprint.high[axis].max(local[axis]);
            }
        }
        footprint
    }

    fn local(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.along;
        [c * x + s * y, c * y - s * x]
    }

    /// Whether a point is in it, with some room along and across the motion, metres.
    pub fn contains(&self, point: [f64; 2], room: [f64; 2]) -> bool {
        let local = self.local(point);
        (0..2).all(|axis| (self.low[axis] - room[axis]..=self.high[axis] + room[axis]).contains(&local[axis]))
    }
}
