//! Rigid motion in closed form: where an object is and how it moves, at any time and without differences.
//!
//! A surface point p of an object at c with velocity v and angular velocity w moves at `v + w x (p - c)`. Every path
//! and spin below has its derivative beside it, so that this velocity is exact.

use glam::{DQuat, DVec3};
use serde::Deserialize;

use super::vector::vector;

/// The pose of an object: object coordinates to world.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pose {
    pub rotation: DQuat,
    /// Metres.
    pub position: DVec3,
}

/// How an object moves.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Twist {
    /// Velocity of the object's origin, metres per unit of time.
    pub velocity: DVec3,
    /// World axes, radians per unit of time.
    pub angular: DVec3,
}

impl Twist {
    /// The velocity of a position on the object, which is at `pose`.
    pub fn at(&self, position: DVec3, pose: &Pose) -> DVec3 {
        self.velocity + self.angular.cross(position - pose.position)
    }
}

/// The path of an object's origin over `s`, time since [`Motion::zero`].
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum Path {
    /// `centre + swing sin(rate s)`: nearly straight through the middle, and in view at any speed.
    Sway {
        #[serde(deserialize_with = "vector")]
        centre: DVec3,
        #[serde(deserialize_with = "vector")]
        swing: DVec3,
        rate: f64,
    },
    /// Along a level circle at the angle `start + rate s + acceleration s^2 / 2`.
    Orbit {
        #[serde(deserialize_with = "vector")]
        centre: DVec3,
        radius: f64,
        start: f64,
        rate: f64,
        acceleration: f64,
    },
    /// Swaying sideways while bouncing on the floor.
    Bounce {
        #[serde(deserialize_with = "vector")]
        centre: DVec3,
        #[serde(deserialize_with = "vector")]
        swing: DVec3,
        rate: f64,
        bounce: Bounce,
    },
    /// `start + velocity s + acceleration s^2 / 2`: a steady or braked slide, free fall, a throw; without both, rest.
    Line {
        #[serde(deserialize_with = "vector")]
        start: DVec3,
        #[serde(default, deserialize_with = "vector")]
        velocity: DVec3,
        #[serde(default, deserialize_with = "vector")]
        acceleration: DVec3,
    },
    /// Evenly until `change`, and then as a line with another velocity: what is pushed, or slides over an edge.
    Pushed {
        #[serde(deserialize_with = "vector")]
        start: DVec3,
        #[serde(deserialize_with = "vector")]
        velocity: DVec3,
        change: f64,
        #[serde(deserialize_with = "vector")]
        after: DVec3,
        #[serde(deserialize_with = "vector")]
        acceleration: DVec3,
    },
    /// At the end of an arm that turns with the body around a pivot: a door, a wing, a pendulum. `arm` is from the
    /// pivot to the body's origin at the angle 0.
    Arm {
        #[serde(deserialize_with = "vector")]
        pivot: DVec3,
        #[serde(deserialize_with = "vector")]
        arm: DVec3,
    },
}

/// The angle of a turn around a fixed axis over `s`, radians.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum Turn {
    /// `rate s + acceleration s^2 / 2`.
    Steady {
        rate: f64,
        #[serde(default)]
        acceleration: f64,
    },
    /// `rate (s - change)` from `change` on, nothing before.
    Pushed { rate: f64, change: f64 },
    /// `rate (1 - exp(-decay s)) / decay`: a rotation that friction slows down.
    Fading { rate: f64, decay: f64 },
    /// `amplitude exp(-decay s) cos(rate s + phase)`: a pendulum, by the law of small angles.
    Swing {
        amplitude: f64,
        rate: f64,
        phase: f64,
        #[serde(default)]
        decay: f64,
    },
}

impl Turn {
    /// The angle, and its derivative by `s`.
    fn at(&self, s: f64) -> (f64, f64) {
        match *self {
            Self::Steady { rate, acceleration } => (rate * s + 0.5 * acceleration * s * s, rate + acceleration * s),
            Self::Pushed { rate, change } => (rate * (s - change).max(0.0), if s < change { 0.0 } else { rate }),
            Self::Fading { rate, decay } => (-rate * (-decay * s).exp_m1() / decay, rate * (-decay * s).exp()),
            Self::Swing { amplitude, rate, phase, decay } => {
                let (sin, cos) = (rate * s + phase).sin_cos();
                let amplitude = amplitude * (-decay * s).exp();
                (amplitude * cos, -amplitude * (rate * sin + decay * cos))
            }
        }
    }
}

/// A ball on a floor: free flight, and a short contact in which an even force turns its velocity round. A contact of no
/// duration would have no velocity at its instant.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bounce {
    /// How far it falls, metres.
    pub height: f64,
    /// How long it falls.
    pub fall: f64,
    /// How long it touches the floor.
    pub contact: f64,
    /// When a contact begins.
    pub touch: f64,
}

impl Bounce {
    /// Height above the lowest position, and its derivative.
    fn height_at(&self, s: f64) -> (f64, f64) {
        let gravity = 2.0 * self.height / (self.fall * self.fall);
        let speed = gravity * self.fall;
        // How deep the even deceleration lets it sink.
        let sink = 0.25 * speed * self.contact;
        let since = (s - self.touch).rem_euclid(2.0 * self.fall + self.contact);
        if since < self.contact {
            let share = since / self.contact;
            (sink - speed * since * (1.0 - share), speed * (2.0 * share - 1.0))
        } else {
            let flight = since - self.contact;
            (sink + speed * flight - 0.5 * gravity * flight * flight, speed - gravity * flight)
        }
    }
}

impl Path {
    /// Position and velocity by `s` of an object that has turned by `turned` and turns at `angular` (world axes,
    /// radians per `s`).
    fn at(&self, s: f64, turned: DQuat, angular: DVec3) -> (DVec3, DVec3) {
        let sway = |swing: DVec3, rate: f64| (swing * (rate * s).sin(), swing * rate * (rate * s).cos());
        match *self {
            Self::Sway { centre, swing, rate } => {
                let (offset, velocity) = sway(swing, rate);
                (centre + offset, velocity)
            }
            Self::Orbit { centre, radius, start, rate, acceleration } => {
                let (sin, cos) = (start + rate * s + 0.5 * acceleration * s * s).sin_cos();
                let turning = rate + acceleration * s;
                (centre + radius * DVec3::new(cos, sin, 0.0), radius * turning * DVec3::new(-sin, cos, 0.0))
            }
            Self::Bounce { centre, swing, rate, bounce } => {
                let (offset, velocity) = sway(swing, rate);
                let (height, climb) = bounce.height_at(s);
                (centre + offset + height * DVec3::Z, velocity + climb * DVec3::Z)
            }
            Self::Line { start, velocity, acceleration } => {
                (start + velocity * s + 0.5 * acceleration * s * s, velocity + acceleration * s)
            }
            Self::Pushed { start, velocity, change, after, acceleration } => {
                let late = (s - change).max(0.0);
                let position = start + velocity * s.min(change) + after * late + 0.5 * acceleration * late * late;
                (position, if s < change { velocity } else { after + acceleration * late })
            }
            Self::Arm { pivot, arm } => {
                let arm = turned * arm;
                (pivot + arm, angular.cross(arm))
            }
        }
    }
}

/// A path and a turn around a fixed axis, both over `s = speed (t - zero)`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Motion {
    pub path: Path,
    /// World axis, length 1.
    pub axis: DVec3,
    pub turn: Turn,
    /// Orientation at the angle 0.
    pub orientation: DQuat,
    /// The time at which `s` is 0.
    pub zero: f64,
    /// How fast `s` passes; 0 holds everything still.
    pub speed: f64,
}

impl Motion {
    /// The object's pose at time `t`, 0 to 1 over the sequence.
    pub fn pose(&self, t: f64) -> Pose {
        let s = self.speed * (t - self.zero);
        let turned = DQuat::from_axis_angle(self.axis, self.turn.at(s).0);
        Pose { rotation: turned * self.orientation, position: self.path.at(s, turned, DVec3::ZERO).0 }
    }

    /// How the object moves at time `t`, per unit of `t`.
    pub fn twist(&self, t: f64) -> Twist {
        let s = self.speed * (t - self.zero);
        let (angle, rate) = self.turn.at(s);
        let turned = DQuat::from_axis_angle(self.axis, angle);
        Twist {
            velocity: self.speed * self.path.at(s, turned, rate * self.axis).1,
            angular: self.speed * rate * self.axis,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(name: &str, motion: &Motion) {
        let h = 1e-5;
        // Two positions on the object; differences of both show the velocity and the turn.
        let solid = [DVec3::new(0.3, -0.2, 0.5), DVec3::new(-0.4, 0.6, 0.1)];
        for step in 0..=20 {
            let t = f64::from(step) / 20.0;
            let at = |t: f64, p: DVec3| {
                let pose = motion.pose(t);
                pose.position + pose.rotation * p
            };
            let (pose, twist) = (motion.pose(t), motion.twist(t));
            let origin = (motion.pose(t + h).position - motion.pose(t - h).position) / (2.0 * h);
            // h^2 / 6 times the third derivative, which is below 500 for rates up to 8, and rounding of 1e-16 / h.
            assert!((origin - twist.velocity).length() < 1e-7, "{name} at {t}: {origin} against {}", twist.velocity);
            for p in solid {
                let (velocity, difference) = (twist.at(at(t, p), &pose), (at(t + h, p) - at(t - h, p)) / (2.0 * h));
                assert!((difference - velocity).length() < 1e-7, "{name} at {t}: {difference} against {velocity}");
            }
            let spin =
                (motion.pose(t + h).rotation * motion.pose(t - h).rotation.conjugate()).to_scaled_axis() / (2.0 * h);
            assert!((spin - twist.angular).length() < 1e-7, "{name} at {t}: {spin} against {}", twist.angular);
        }
    }

    #[test]
    fn twists_are_derivatives_of_poses() {
        let axis = DVec3::new(0.3, -0.8, 0.5).normalize();
        let v = DVec3::new;
        let rest = Turn::Steady { rate: 0.0, acceleration: 0.0 };
        let line =
            |velocity: DVec3, acceleration: DVec3| Path::Line { start: v(0.1, 0.2, 0.9), velocity, acceleration };
        let arm = Path::Arm { pivot: v(0.2, -0.5, 0.4), arm: v(0.6, 0.3, -0.2) };
        let steady = |rate: f64, acceleration: f64| Turn::Steady { rate, acceleration };
        let swing = Turn::Swing { amplitude: 0.6, rate: 5.0, phase: 0.4, decay: 0.0 };
        // No time of the check is that of the push.
        let pushed = Path::Pushed {
            start: v(0.1, 0.2, 0.9),
            velocity: v(0.5, 0.1, 0.0),
            change: 0.31,
            after: v(0.4, -0.2, 0.6),
            acceleration: v(0.0, 0.0, -4.0),
        };
        let cases = [
            ("rest", line(DVec3::ZERO, DVec3::ZERO), rest),
            ("free fall", line(DVec3::ZERO, v(0.0, 0.0, -3.5)), rest),
            ("throw with spin", line(v(0.4, -0.2, 2.0), v(0.0, 0.0, -4.0)), steady(2.0, 0.0)),
            ("steady slide", line(v(1.2, 0.3, 0.0), DVec3::ZERO), rest),
            ("braked slide", line(v(2.4, 0.0, 0.0), v(-1.6, 0.0, 0.0)), rest),
            ("rotation in place", line(DVec3::ZERO, DVec3::ZERO), steady(7.8, 0.0)),
            ("accelerated rotation", line(DVec3::ZERO, DVec3::ZERO), steady(1.5, 5.0)),
            ("rotation about a pivot", arm, steady(3.0, 0.0)),
            ("hinge", arm, steady(0.3, 2.6)),
            ("pendulum", arm, swing),
            ("dying pendulum", arm, Turn::Swing { amplitude: 0.6, rate: 5.0, phase: 0.4, decay: 1.4 }),
            ("spin that dies away", arm, Turn::Fading { rate: 2.0, decay: 0.8 }),
            ("push", pushed, Turn::Pushed { rate: 3.0, change: 0.31 }),
            ("sway", Path::Sway { centre: v(0.0, 0.1, 0.7), swing: v(0.7, 0.3, 0.1), rate: 2.1 }, steady(1.4, 0.0)),
        ];
        for (name, path, turn) in cases {
            for (zero, speed) in [(0.0, 1.0), (0.5, -1.5)] {
                let orientation = DQuat::from_rotation_x(0.35) * DQuat::from_rotation_z(0.6);
                check(name, &Motion { path, axis, turn, orientation, zero, speed });
            }
        }
    }

    /// Laws that can be told without derivatives: where a fall, a turn and a pendulum are at t = 1.
    #[test]
    fn positions_follow_their_laws() {
        let path = Path::Line { start: DVec3::Z, velocity: DVec3::X, acceleration: DVec3::new(0.0, 0.0, -4.0) };
        let still = Turn::Steady { rate: 0.0, acceleration: 0.0 };
        let motion = Motion { path, axis: DVec3::Z, turn: still, orientation: DQuat::IDENTITY, zero: 0.0, speed: 1.0 };
        assert!(motion.pose(1.0).position.distance(DVec3::new(1.0, 0.0, -1.0)) < 1e-15);
        let arm = Path::Arm { pivot: DVec3::X, arm: DVec3::X };
        let half = Motion { path: arm, turn: Turn::Steady { rate: std::f64::consts::PI, acceleration: 0.0 }, ..motion };
        assert!(half.pose(1.0).position.length() < 1e-15, "half a turn about the pivot");
        let turn = Turn::Swing { amplitude: 0.5, rate: std::f64::consts::PI, phase: 0.0, decay: 0.0 };
        let pendulum = Motion { turn, ..half };
        let angle = |t: f64| pendulum.pose(t).rotation.to_scaled_axis().z;
        assert!((angle(0.0) - 0.5).abs() < 1e-12 && angle(0.5).abs() < 1e-12 && (angle(1.0) + 0.5).abs() < 1e-12);
    }
}
