//! The object worlds: bodies within about 1.2 m of the origin before a transparent background. Units are metres; z is up.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DQuat, DVec3};

use super::super::tracer::motion::{Motion, Path, Turn};
use super::super::tracer::solid::{Form, Part, Solid};
use super::super::tracer::stage::MovingObject;
use super::super::tracer::texture::{Pattern, Texture};

/// Makes textures: a pattern, the side of its largest cells (metres) and three colours (linear light).
pub(super) type Paint<'a> = dyn FnMut(Pattern, f64, [[f64; 3]; 3]) -> Texture + 'a;

/// Bodies of a world: those at rest and those that move.
pub(super) struct Bodies {
    pub still: Vec<(DVec3, Solid)>,
    pub moving: Vec<MovingObject>,
}

pub(super) fn part(form: Form, position: [f64; 3], texture: Texture) -> Part {
    Part { form, position: DVec3::from_array(position), turn: DQuat::IDENTITY, texture }
}

pub(super) fn cuboid(x: f64, y: f64, z: f64) -> Form {
    Form::Cuboid { half: DVec3::new(x, y, z) }
}

pub(super) fn ball(radius: f64) -> Form {
    Form::Sphere { radius }
}

/// One body at rest, its parts relative to `position`.
pub(super) fn at_rest(position: [f64; 3], parts: Vec<Part>) -> (DVec3, Solid) {
    (DVec3::from_array(position), Solid::new(parts))
}

/// A motion that begins at `start`, with velocity and acceleration, and does not turn.
pub(super) fn line(start: [f64; 3], velocity: [f64; 3], acceleration: [f64; 3]) -> Motion {
    let [start, velocity, acceleration] = [start, velocity, acceleration].map(DVec3::from_array);
    Motion {
        path: Path::Line { start, velocity, acceleration },
        axis: DVec3::Z,
        turn: Turn::Steady { rate: 0.0, acceleration: 0.0 },
        orientation: DQuat::IDENTITY,
        zero: 0.0,
        speed: 1.0,
    }
}

/// The motion with a turn about `axis` at `rate`, radians per unit of time, that grows by `acceleration`.
pub(super) fn turning(motion: Motion, axis: [f64; 3], rate: f64, acceleration: f64) -> Motion {
    Motion { axis: DVec3::from_array(axis).normalize(), turn: Turn::Steady { rate, acceleration }, ..motion }
}

/// A motion that only turns, about an axis through the object's origin at `position`.
pub(super) fn spin(position: [f64; 3], axis: [f64; 3], rate: f64, acceleration: f64) -> Motion {
    turning(line(position, [0.0; 3], [0.0; 3]), axis, rate, acceleration)
}

/// A pendulum below `pivot` that swings about `axis` (level); `period` in units of time.
pub(super) fn swinging(
    pivot: [f64; 3],
    axis: [f64; 3],
    length: f64,
    amplitude: f64,
    period: f64,
    phase: f64,
) -> Motion {
    Motion {
        path: Path::Arm { pivot: DVec3::from_array(pivot), arm: DVec3::new(0.0, 0.0, -length) },
        axis: DVec3::from_array(axis).normalize(),
        turn: Turn::Swing { amplitude, rate: TAU / period, phase },
        ..line([0.0; 3], [0.0; 3], [0.0; 3])
    }
}

pub(super) fn moving(name: &'static str, parts: Vec<Part>, motion: Motion) -> MovingObject {
    MovingObject { name, solid: Solid::new(parts), motion }
}

const RED: [[f64; 3]; 3] = [[0.78, 0.10, 0.06], [0.86, 0.52, 0.12], [0.90, 0.84, 0.70]];
const BLUE: [[f64; 3]; 3] = [[0.06, 0.22, 0.58], [0.14, 0.52, 0.66], [0.85, 0.86, 0.82]];
const GREEN: [[f64; 3]; 3] = [[0.08, 0.40, 0.16], [0.50, 0.62, 0.14], [0.88, 0.82, 0.40]];
const WOOD: [[f64; 3]; 3] = [[0.42, 0.24, 0.11], [0.66, 0.44, 0.24], [0.24, 0.13, 0.06]];
const STONE: [[f64; 3]; 3] = [[0.44, 0.46, 0.48], [0.66, 0.64, 0.60], [0.26, 0.28, 0.32]];

/// Three blades in three paints, 1.25 turns per unit of time, before a housing on a stand.
pub(super) fn fan(paint: &mut Paint) -> Bodies {
    let stone = paint(Pattern::Plaster, 0.22, STONE);
    let wood = paint(Pattern::Planks, 0.10, WOOD);
    let blades = [RED, BLUE, GREEN].map(|colors| paint(Pattern::Mosaic, 0.12, colors));
    let hub = paint(Pattern::Ball, 0.06, BLUE);
    let mut parts = vec![part(ball(0.15), [0.0; 3], hub)];
    for (index, texture) in blades.into_iter().enumerate() {
        // The rotor's axis is y; a blade is pitched about its own length.
        let around = DQuat::from_rotation_y(TAU * index as f64 / 3.0);
        let turn = around * DQuat::from_rotation_x(0.5);
        let position = around * DVec3::new(0.48, 0.0, 0.0);
        parts.push(Part { form: cuboid(0.36, 0.025, 0.15), position, turn, texture });
    }
    let stand = vec![
        part(cuboid(0.42, 0.36, 0.05), [0.0, 0.0, -0.95], wood),
        part(cuboid(0.07, 0.07, 0.52), [0.0, 0.05, -0.42], stone),
        part(ball(0.20), [0.0, 0.08, 0.20], stone),
    ];
    let rotor = spin([0.0, -0.26, 0.20], [0.0, -1.0, 0.0], 1.25 * TAU, 0.0);
    Bodies { still: vec![at_rest([0.0; 3], stand)], moving: vec![moving("rotor", parts, rotor)] }
}

/// A ball that is let go at time 0 and turns slowly, beside a column with a ring.
pub(super) fn falling_ball(paint: &mut Paint) -> Bodies {
    let skin = paint(Pattern::Ball, 0.06, RED);
    let stone = paint(Pattern::Bricks, 0.24, STONE);
    let green = paint(Pattern::Fur, 0.14, GREEN);
    let column = vec![
        part(cuboid(0.28, 0.28, 0.55), [0.0, 0.0, -0.45], stone),
        part(Form::Torus { major: 0.24, minor: 0.10 }, [0.0, 0.0, 0.20], green),
    ];
    let fall = turning(line([-0.42, 0.0, 0.92], [0.0; 3], [0.0, 0.0, -3.4]), [0.4, 1.0, 0.1], 1.2, 0.0);
    let ball = moving("ball", vec![part(ball(0.30), [0.0; 3], skin)], fall);
    Bodies { still: vec![at_rest([0.50, 0.10, 0.0], column)], moving: vec![ball] }
}

/// A box on a rail that slows from 2.5 to 0.7 metres per unit of time, past a bumpy stone.
pub(super) fn slider(paint: &mut Paint) -> Bodies {
    let rail = paint(Pattern::Planks, 0.12, WOOD);
    let tiles = paint(Pattern::Mosaic, 0.11, BLUE);
    let skin = paint(Pattern::Skin, 0.10, RED);
    let rest = vec![
        part(cuboid(1.20, 0.62, 0.05), [0.0, 0.0, -0.60], rail),
        part(Form::Bumpy { radius: 0.30, relief: 0.06 }, [0.15, 0.32, -0.24], skin),
    ];
    let slide = line([-0.85, -0.28, -0.31], [2.5, 0.0, 0.0], [-1.8, 0.0, 0.0]);
    let slide = moving("box", vec![part(cuboid(0.24, 0.22, 0.24), [0.0; 3], tiles)], slide);
    Bodies { still: vec![at_rest([0.0; 3], rest)], moving: vec![slide] }
}

/// A ball on a rod that swings by 0.6 radians either way with a period of 1.3, in a frame.
pub(super) fn pendulum(paint: &mut Paint) -> Bodies {
    let wood = paint(Pattern::Planks, 0.09, WOOD);
    let skin = paint(Pattern::Ball, 0.05, GREEN);
    let steel = paint(Pattern::Plaster, 0.09, STONE);
    let frame = vec![
        part(cuboid(0.07, 0.80, 0.07), [0.0, 0.0, 1.00], wood),
        part(cuboid(0.07, 0.07, 0.95), [0.0, -0.73, 0.0], wood),
        part(cuboid(0.07, 0.07, 0.95), [0.0, 0.73, 0.0], wood),
        part(cuboid(0.40, 0.80, 0.05), [0.0, 0.0, -1.0], steel),
    ];
    let parts = vec![part(ball(0.24), [0.0; 3], skin), part(cuboid(0.035, 0.035, 0.53), [0.0, 0.0, 0.75], steel)];
    let swing = swinging([0.0, 0.0, 0.88], [0.0, 1.0, 0.0], 1.28, 0.6, 1.3, 0.0);
    Bodies { still: vec![at_rest([0.0; 3], frame)], moving: vec![moving("bob", parts, swing)] }
}

/// A lid that opens by 92 degrees, ever faster, about the upper back edge of a box.
pub(super) fn hinge(paint: &mut Paint) -> Bodies {
    let wood = paint(Pattern::Planks, 0.11, WOOD);
    let top = paint(Pattern::Mosaic, 0.15, GREEN);
    let tiles = paint(Pattern::Mosaic, 0.12, RED);
    let blue = paint(Pattern::Fur, 0.14, BLUE);
    let chest = vec![
        part(cuboid(0.70, 0.45, 0.30), [0.0, 0.0, -0.50], wood),
        // What the lid uncovers.
        part(cuboid(0.60, 0.36, 0.02), [0.0, 0.0, -0.19], top),
    ];
    let lid = vec![part(cuboid(0.72, 0.47, 0.06), [0.0; 3], tiles), part(ball(0.10), [0.0, -0.30, 0.08], blue)];
    let opening = Motion {
        path: Path::Arm { pivot: DVec3::new(0.0, 0.47, -0.10), arm: DVec3::new(0.0, -0.47, 0.0) },
        ..spin([0.0; 3], [-1.0, 0.0, 0.0], 0.3, 2.6)
    };
    Bodies { still: vec![at_rest([0.0; 3], chest)], moving: vec![moving("lid", lid, opening)] }
}

/// Three boxes, one in the other, that move apart along z at -0.45, 0.10 and 0.70 metres per unit of time.
pub(super) fn telescope(paint: &mut Paint) -> Bodies {
    let outer = paint(Pattern::Mosaic, 0.15, BLUE);
    let middle = paint(Pattern::Fur, 0.16, RED);
    let inner = paint(Pattern::Bricks, 0.18, GREEN);
    let tube = |name, half: f64, z: f64, velocity: f64, texture| {
        let motion = line([0.0, 0.0, z], [0.0, 0.0, velocity], [0.0; 3]);
        moving(name, vec![part(cuboid(half, half, 0.35), [0.0; 3], texture)], motion)
    };
    let moving = vec![
        tube("outer", 0.42, -0.20, -0.45, outer),
        tube("middle", 0.31, -0.12, 0.10, middle),
        tube("inner", 0.20, -0.04, 0.70, inner),
    ];
    Bodies { still: Vec::new(), moving }
}

/// A body with arms of different lengths that turns about a tilted axis, from 1.5 to 6.5 radians per unit of time.
pub(super) fn spinner(paint: &mut Paint) -> Bodies {
    let red = paint(Pattern::Skin, 0.12, RED);
    let blue = paint(Pattern::Mosaic, 0.12, BLUE);
    let green = paint(Pattern::Ball, 0.05, GREEN);
    let stone = paint(Pattern::Plaster, 0.15, STONE);
    let parts = vec![
        part(Form::Bumpy { radius: 0.36, relief: 0.06 }, [0.0; 3], red),
        part(cuboid(0.34, 0.12, 0.12), [0.60, 0.0, 0.0], blue),
        part(ball(0.20), [-0.25, 0.52, 0.10], green),
        Part {
            turn: DQuat::from_rotation_x(FRAC_PI_2),
            ..part(Form::Torus { major: 0.20, minor: 0.07 }, [-0.45, -0.25, 0.05], stone)
        },
    ];
    let body = moving("spinner", parts, spin([0.0; 3], [0.25, 0.1, 1.0], 1.5, 5.0));
    Bodies { still: Vec::new(), moving: vec![body] }
}

/// A bumpy ball that is thrown up and comes down, and a box that drifts and turns.
pub(super) fn duo(paint: &mut Paint) -> Bodies {
    let skin = paint(Pattern::Skin, 0.10, GREEN);
    let tiles = paint(Pattern::Mosaic, 0.12, RED);
    let throw = turning(line([-0.75, -0.20, -0.55], [0.45, 0.10, 2.7], [0.0, 0.0, -4.6]), [0.2, 1.0, 0.3], 1.8, 0.0);
    let drift = turning(line([0.80, 0.20, 0.30], [-0.35, 0.20, -0.50], [0.0; 3]), [0.3, 0.2, 1.0], 2.2, 0.0);
    let moving = vec![
        moving("ball", vec![part(Form::Bumpy { radius: 0.30, relief: 0.06 }, [0.0; 3], skin)], throw),
        moving("box", vec![part(cuboid(0.26, 0.22, 0.26), [0.0; 3], tiles)], drift),
    ];
    Bodies { still: Vec::new(), moving }
}
