//! The bodies of [`World::Random`](super::World::Random): shapes, laws of motion and places as the seed draws them. A
//! body's name is that of its law.

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use crate::named::named;
use crate::tracer::motion::{Motion, Path, Turn};
use crate::tracer::scene::MovingBody;
use crate::tracer::shape::Shape;
use crate::tracer::solid::{Part, Solid};
use crate::tracer::texture::{Pattern, Texture};

named! {
    /// A law of motion.
    pub enum Planted {
        /// Steady.
        Slide = "slide",
        /// Ever slower.
        Brake = "brake",
        /// Free flight without a rotation.
        Throw = "throw",
        /// Free flight with a rotation about the middle.
        Tumble = "tumble",
        /// Free flight with a rotation about a point off the middle.
        Lopsided = "lopsided",
        /// Steady, with a rotation.
        Drift = "drift",
        /// A rotation about the middle.
        Spin = "spin",
        /// A rotation about the middle, ever faster.
        SpinUp = "spin-up",
        /// A rotation about the middle, ever slower.
        SpinDown = "spin-down",
        /// A rotation about a pivot outside.
        Orbit = "orbit",
        /// A rotation about a pivot outside, ever faster.
        Hinge = "hinge",
        /// To and fro about a pivot above.
        Pendulum = "pendulum",
        /// To and fro about a pivot above, ever less.
        DyingPendulum = "dying-pendulum",
        /// To and fro along a line.
        Spring = "spring",
        /// Rest, then free flight with a rotation.
        Pushed = "pushed",
    }
}

/// Most bodies.
const BODIES: usize = 3;

/// Bodies stay within this distance of the middle, metres: all cameras see them whole.
const REACH: f64 = 1.3;

/// Bodies stay above this height, metres: a centimetre above what rests.
const GROUND: f64 = -0.93;

/// Times at which bodies must be inside and apart.
const TIMES: u32 = 40;

/// Laws that are drawn at most.
const LAWS: usize = 100;

/// Bodies that are drawn by a law before another law is: each law is then about as frequent, however far it leads.
const TRIES: usize = 500;

const PATTERNS: [Pattern; 5] = [Pattern::Mosaic, Pattern::Planks, Pattern::Plaster, Pattern::Fur, Pattern::Skin];

/// One to [`BODIES`] bodies that do not touch each other.
pub(super) fn bodies(rng: &mut ChaCha8Rng) -> Vec<MovingBody> {
    let count = rng.random_range(1..=BODIES);
    let mut bodies: Vec<MovingBody> = Vec::new();
    // Two bodies may leave no room for a third.
    for _ in 0..LAWS {
        if bodies.len() == count {
            break;
        }
        let law = Planted::ALL[rng.random_range(0..Planted::ALL.len())];
        let mut tries = (0..TRIES).map(|_| body(law, rng));
        bodies.extend(tries.find(|body| is_inside(body) && bodies.iter().all(|other| are_apart(body, other))));
    }
    bodies
}

fn is_inside(body: &MovingBody) -> bool {
    times().all(|t| {
        let position = body.motion.pose(t).position;
        position.length() + body.solid.radius < REACH && position.z - body.solid.radius > GROUND
    })
}

fn are_apart(a: &MovingBody, b: &MovingBody) -> bool {
    let apart = |t| a.motion.pose(t).position.distance(b.motion.pose(t).position);
    times().all(|t| apart(t) > a.solid.radius + b.solid.radius)
}

fn times() -> impl Iterator<Item = f64> {
    (0..=TIMES).map(|i| f64::from(i) / f64::from(TIMES))
}

fn body(law: Planted, rng: &mut ChaCha8Rng) -> MovingBody {
    let offset = if law == Planted::Lopsided { rng.random_range(0.1..0.2) * direction(rng) } else { DVec3::ZERO };
    let beside = offset + rng.random_range(0.1..0.2) * direction(rng);
    let parts = [part(rng, offset, 1.0), part(rng, beside, 0.7)];
    let solid = Solid::new(parts[..rng.random_range(1..=2)].to_vec());
    MovingBody { name: law.name().into(), solid, motion: motion(law, rng) }
}

fn part(rng: &mut ChaCha8Rng, position: DVec3, scale: f64) -> Part {
    let side = |rng: &mut ChaCha8Rng| scale * rng.random_range(0.12..0.26);
    let shape = match rng.random_range(0..4) {
        0 => Shape::Column { radius: side(rng), half_height: side(rng) },
        1 => Shape::Bumpy { radius: side(rng), relief: 0.15 },
        _ => Shape::Cuboid { half: DVec3::new(side(rng), side(rng), side(rng)) },
    };
    let pattern = PATTERNS[rng.random_range(0..PATTERNS.len())];
    let colors = [(); 3].map(|()| DVec3::from_array([(); 3].map(|()| rng.random_range(0.05..0.95))));
    let paint = Texture { pattern, size: rng.random_range(0.06..0.14), colors, salt: rng.random() };
    Part { turn: turned(rng), ..Part::new(shape, position, paint) }
}

fn direction(rng: &mut ChaCha8Rng) -> DVec3 {
    let z: f64 = rng.random_range(-1.0..1.0);
    let (sin, cos) = rng.random_range(0.0..TAU).sin_cos();
    (1.0 - z * z).sqrt() * DVec3::new(cos, sin, 0.0) + z * DVec3::Z
}

fn level(rng: &mut ChaCha8Rng) -> DVec3 {
    let (sin, cos) = rng.random_range(0.0..TAU).sin_cos();
    DVec3::new(cos, sin, 0.0)
}

fn turned(rng: &mut ChaCha8Rng) -> DQuat {
    DQuat::from_axis_angle(direction(rng), rng.random_range(0.0..TAU))
}

/// A motion by `law`. Speeds are those of a body that crosses half of the view, rotations those of up to a turn,
/// oscillations those of 0.7 to 1.4 periods.
fn motion(law: Planted, rng: &mut ChaCha8Rng) -> Motion {
    let (place, rest) = (rng.random_range(0.0..0.9) * direction(rng), Turn::Steady { rate: 0.0, acceleration: 0.0 });
    let (across, around) = (level(rng), direction(rng));
    let mut between = |low: f64, high: f64| rng.random_range(low..high);
    let even = Turn::Steady { rate: between(1.5, 5.0), acceleration: 0.0 };
    let faster = Turn::Steady { rate: between(0.3, 1.5), acceleration: between(2.5, 6.0) };
    let fall = DVec3::new(0.0, 0.0, -between(3.0, 6.0));
    let up = across * between(0.2, 0.8) + DVec3::Z * between(0.8, 2.5);
    let line = |velocity: DVec3, acceleration: DVec3| Path::Line { start: place, velocity, acceleration };
    let slide = line(across * between(0.6, 1.4), DVec3::ZERO);
    let fixed = line(DVec3::ZERO, DVec3::ZERO);
    let outside = Path::Arm { pivot: place, arm: across * between(0.35, 0.8) };
    let hanging = Path::Arm { pivot: DVec3::new(place.x, place.y, 0.9), arm: DVec3::new(0.0, 0.0, -between(0.7, 1.3)) };
    let swing = |decay, amplitude, rate, phase| Turn::Swing { amplitude, rate, phase, decay };
    let (amplitude, rate, phase) = (between(0.35, 0.8), between(4.5, 9.0), between(0.0, TAU));
    let (path, axis, turn) = match law {
        Planted::Slide => (slide, around, rest),
        Planted::Brake => {
            let velocity = across * between(1.2, 2.2);
            (line(velocity, -velocity * between(0.6, 0.95)), around, rest)
        }
        Planted::Throw => (line(up, fall), around, rest),
        Planted::Tumble | Planted::Lopsided => (line(up, fall), around, even),
        Planted::Drift => (slide, around, even),
        Planted::Spin => (fixed, around, even),
        Planted::SpinUp => (fixed, around, faster),
        Planted::SpinDown => (fixed, around, Turn::Fading { rate: between(5.0, 9.0), decay: between(1.2, 2.5) }),
        Planted::Orbit => (outside, DVec3::Z, even),
        Planted::Hinge => (outside, DVec3::Z, faster),
        Planted::Pendulum => (hanging, across, swing(0.0, amplitude, rate, phase)),
        Planted::DyingPendulum => (hanging, across, swing(between(1.0, 2.2), amplitude, rate, phase)),
        Planted::Spring => (Path::Sway { centre: place, swing: across * between(0.2, 0.5), rate }, around, rest),
        Planted::Pushed => {
            let change = between(0.15, 0.35);
            let path = Path::Pushed { start: place, velocity: DVec3::ZERO, change, after: up, acceleration: fall };
            (path, around, Turn::Pushed { rate: between(1.5, 5.0), change })
        }
    };
    Motion { path, axis, turn, orientation: turned(rng), zero: 0.0, speed: 1.0 }
}
