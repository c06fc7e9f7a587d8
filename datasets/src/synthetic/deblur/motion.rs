//! Rigid motion in closed form: where an object is and how it moves, at any time and without differences.
//!
//! A surface point p of an object at c with velocity v and angular velocity w moves at `v + w x (p - c)`. Every path and
//! spin below has its derivative beside it, so that this velocity is exact.

use glam::{DQuat, DVec3};

/// The pose of an object: object coordinates to world.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pose {
    pub rotation: DQuat,
    /// Metres.
    pub position: DVec3,
}

/// How an object moves.
#[derive(Debug, Clone, Copy)]
pub(super) struct Twist {
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

/// The path of an object's origin over `s`, time from the middle of the sequence.
#[derive(Debug, Clone, Copy)]
pub(super) enum Path {
    /// `centre + swing sin(rate s)`: nearly straight through the middle, and in view at any speed.
    Sway { centre: DVec3, swing: DVec3, rate: f64 },
    /// Along a level circle at the angle `start + rate s + acceleration s^2 / 2`.
    Orbit { centre: DVec3, radius: f64, start: f64, rate: f64, acceleration: f64 },
    /// Swaying sideways while bouncing on the floor.
    Bounce { centre: DVec3, swing: DVec3, rate: f64, bounce: Bounce },
}

/// A ball on a floor: free flight, and a short contact in which an even force turns its velocity round. A contact of no
/// duration would have no velocity at its instant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bounce {
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
    /// Position and velocity.
    fn at(&self, s: f64) -> (DVec3, DVec3) {
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
        }
    }
}

/// A path and a turn around a fixed axis: the angle is `rate s + acceleration s^2 / 2`, `s = speed (t - 0.5)`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motion {
    pub path: Path,
    /// World axis, length 1.
    pub axis: DVec3,
    /// Radians per unit of `s`.
    pub rate: f64,
    /// Radians per unit of `s` squared.
    pub acceleration: f64,
    /// Orientation at the middle of the sequence.
    pub turn: DQuat,
    /// How fast `s` passes; 0 holds everything still.
    pub speed: f64,
}

impl Motion {
    /// The object's pose at time `t`, 0 to 1 over the sequence.
    pub fn pose(&self, t: f64) -> Pose {
        let s = self.speed * (t - 0.5);
        let angle = self.rate * s + 0.5 * self.acceleration * s * s;
        Pose { rotation: DQuat::from_axis_angle(self.axis, angle) * self.turn, position: self.path.at(s).0 }
    }

    /// How the object moves at time `t`, per unit of `t`.
    pub fn twist(&self, t: f64) -> Twist {
        let s = self.speed * (t - 0.5);
        Twist {
            velocity: self.speed * self.path.at(s).1,
            angular: self.speed * (self.rate + self.acceleration * s) * self.axis,
        }
    }
}
