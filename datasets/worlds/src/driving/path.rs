//! Paths of vehicles and people in closed form: a straight line, an arc, a straight line, driven with one change of
//! speed.

use glam::{DQuat, DVec2};

use crate::tracer::motion::Pose;

/// The position and heading of a body, seen from above.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stand {
    /// Metres, street axes: x along the street, y to its left.
    pub position: DVec2,
    /// Heading from the x axis, radians.
    pub yaw: f64,
}

impl Stand {
    /// The pose on the ground.
    pub fn pose(&self) -> Pose {
        Pose { rotation: DQuat::from_rotation_z(self.yaw), position: self.position.extend(0.0) }
    }
}

/// A turn: how far the path is straight before it, its radius (metres) and its angle (radians, to the left above 0).
#[derive(Debug, Clone, Copy)]
pub(super) struct Turn {
    pub after: f64,
    pub radius: f64,
    pub angle: f64,
}

/// A change of speed: from `begin` on the speed changes by `acceleration` (metres per second squared) until it is
/// `end`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Change {
    pub begin: f64,
    pub acceleration: f64,
    pub end: f64,
}

/// A path over time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Path {
    pub start: Stand,
    /// Metres per second at time 0.
    pub speed: f64,
    pub change: Option<Change>,
    pub turn: Option<Turn>,
}

impl Path {
    /// A path that does not move.
    pub fn still(start: Stand) -> Self {
        Self { start, speed: 0.0, change: None, turn: None }
    }

    /// Whether it ever moves.
    pub fn moves(&self) -> bool {
        self.speed != 0.0 || self.change.is_some()
    }

    /// Distance driven at time `t` (seconds; negative before the start), and the speed there.
    pub fn driven(&self, t: f64) -> (f64, f64) {
        let Some(Change { begin, acceleration, end }) = self.change.filter(|change| t > change.begin) else {
            return (self.speed * t, self.speed);
        };
        let duration = ((end - self.speed) / acceleration).max(0.0);
        let since = (t - begin).min(duration);
        let after = t - begin - since;
        let speed = self.speed + acceleration * since;
        (self.speed * begin + self.speed * since + 0.5 * acceleration * since * since + speed * after, speed)
    }

    /// The position and heading at time `t`.
    pub fn at(&self, t: f64) -> Stand {
        let s = self.driven(t).0;
        let Stand { position, yaw } = self.start;
        let ahead = |yaw: f64| DVec2::new(yaw.cos(), yaw.sin());
        let Some(Turn { after, radius, angle }) = self.turn.filter(|turn| s > turn.after) else {
            return Stand { position: position + s * ahead(yaw), yaw };
        };
        let side = angle.signum();
        let turned = ((s - after) / radius).min(angle.abs());
        let rest = s - after - turned * radius;
        let begin = position + after * ahead(yaw);
        let centre = begin + side * radius * ahead(yaw).perp();
        let now = yaw + side * turned;
        Stand { position: centre - side * radius * ahead(now).perp() + rest * ahead(now), yaw: now }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn speed_is_the_derivative_of_the_way() {
        let start = Stand { position: DVec2::new(3.0, -1.0), yaw: 0.4 };
        let change = Some(Change { begin: 1.0, acceleration: -3.0, end: 0.0 });
        let turn = Some(Turn { after: 6.0, radius: 7.0, angle: -FRAC_PI_2 });
        let path = Path { start, speed: 9.0, change, turn };
        for step in 0..60 {
            // Away from the instants at which speed or curvature changes, by half a step.
            let t = 0.1 * f64::from(step) + 0.05;
            let h = 1e-6;
            let way = (path.at(t + h).position - path.at(t - h).position).length() / (2.0 * h);
            assert!((way - path.driven(t).1).abs() < 1e-4, "{t}: {way} against {}", path.driven(t).1);
        }
        // It stops after 9 m/s over 3 m/s^2 = 3 s; the path is 9 + 13.5 m long, of which the arc takes 11 m.
        assert_eq!(path.at(4.0), path.at(9.0));
        assert!((path.at(4.0).yaw - (0.4 - FRAC_PI_2)).abs() < 1e-12);
    }
}
