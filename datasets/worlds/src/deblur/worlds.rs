//! The worlds: one room, one moving object each after the paper's scenes (and one with two), and static objects that a mask
//! must not include.
//!
//! Units are metres; z is up; the cameras look along +y. At the default camera a metre at the target is about 76
//! pixels of a 256 pixel wide image, so a metre per unit of time is about 4.6 pixels per exposure of 0.06.

use glam::{DQuat, DVec3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::super::tracer::motion::{Bounce, Motion, Path, Pose, Turn};
use super::super::tracer::solid::{Form, Part, Solid};
use super::super::tracer::stage::{Lamp, MovingObject, Plane, Stage};
use super::super::tracer::texture::{Pattern, Texture};
use super::World;

/// Half the room's width, the positions of its back and front wall, metres.
const ROOM: (f64, f64, f64) = (3.0, 2.3, -5.0);

/// Objects are at the same position at this time for any speed.
const MIDDLE: f64 = 0.5;

/// Radius of the floor in the open, metres.
const GROUND: f64 = 5.0;

/// Builds a world, in a room or in the `open`; textures and the static objects' turns come from `rng`.
pub(super) fn stage(world: World, speed: f64, open: bool, rng: &mut ChaCha8Rng) -> Stage {
    let mut paint = |pattern, size, colors: [[f64; 3]; 3]| Texture {
        pattern,
        size,
        colors: colors.map(DVec3::from_array),
        salt: rng.random(),
    };
    let mut objects = match world {
        World::Cube => vec![cube(&mut paint)],
        World::Lychee => vec![lychee(&mut paint)],
        World::Monkey => vec![monkey(&mut paint)],
        World::Sphere => vec![sphere(&mut paint)],
        World::Pair => pair(&mut paint),
    };
    let mut planes = room(world, &mut paint);
    if open {
        planes.truncate(1);
        planes[0].reach = GROUND;
    }
    let lamp = Lamp::new(DVec3::new(1.4, -2.2, 4.0), 0.5);
    let still = distractors(world, &mut paint)
        .into_iter()
        .map(|(position, part)| {
            let turn = DQuat::from_rotation_z(rng.random_range(-0.4..0.4));
            (lamp.posed(Pose { rotation: turn, position }), Solid::new(vec![part]))
        })
        .collect();
    for object in &mut objects {
        object.motion.speed = speed;
    }
    Stage {
        planes,
        still,
        objects,
        lamp,
        lamp_color: DVec3::new(0.92, 0.86, 0.76),
        sky: [DVec3::new(0.24, 0.27, 0.33), DVec3::new(0.12, 0.11, 0.10)],
    }
}

fn part(form: Form, position: [f64; 3], texture: Texture) -> Part {
    Part { form, position: DVec3::from_array(position), turn: DQuat::IDENTITY, texture }
}

fn motion(path: Path, axis: [f64; 3], rate: f64, acceleration: f64) -> Motion {
    let axis = DVec3::from_array(axis).normalize();
    let turn = Turn::Steady { rate, acceleration };
    Motion { path, axis, turn, orientation: DQuat::IDENTITY, zero: MIDDLE, speed: 1.0 }
}

type Paint<'a> = dyn FnMut(Pattern, f64, [[f64; 3]; 3]) -> Texture + 'a;

/// A tilted box that crosses the room while it turns.
fn cube(paint: &mut Paint) -> MovingObject {
    let texture = paint(Pattern::Mosaic, 0.12, [[0.80, 0.62, 0.10], [0.08, 0.25, 0.60], [0.85, 0.83, 0.78]]);
    let solid = Solid::new(vec![part(Form::Cuboid { half: DVec3::splat(0.34) }, [0.0; 3], texture)]);
    let path = Path::Sway { centre: DVec3::new(0.0, 0.05, 0.78), swing: DVec3::new(0.78, 0.30, 0.10), rate: 2.1 };
    let mut motion = motion(path, [0.35, 0.15, 1.0], 1.4, 0.0);
    motion.orientation = DQuat::from_rotation_x(0.35) * DQuat::from_rotation_z(0.6);
    MovingObject { name: "cube", solid, motion }
}

/// A bumpy fruit that spins about a tilted axis and drifts.
fn lychee(paint: &mut Paint) -> MovingObject {
    let texture = paint(Pattern::Skin, 0.11, [[0.30, 0.02, 0.04], [0.80, 0.16, 0.14], [0.88, 0.72, 0.45]]);
    let solid = Solid::new(vec![part(Form::Bumpy { radius: 0.56, relief: 0.07 }, [0.0; 3], texture)]);
    let path = Path::Sway { centre: DVec3::new(0.0, 0.0, 0.68), swing: DVec3::new(0.40, 0.12, 0.05), rate: 1.6 };
    MovingObject { name: "lychee", solid, motion: motion(path, [0.25, 0.15, 1.0], 2.0, 0.0) }
}

/// A head of spheres and rings that runs around a bend, ever faster, and turns with it.
fn monkey(paint: &mut Paint) -> MovingObject {
    let fur = paint(Pattern::Fur, 0.13, [[0.42, 0.22, 0.08], [0.10, 0.05, 0.02], [0.75, 0.55, 0.30]]);
    let skin = paint(Pattern::Plaster, 0.10, [[0.80, 0.55, 0.36], [0.62, 0.36, 0.22], [0.40, 0.16, 0.10]]);
    let ring = paint(Pattern::Mosaic, 0.09, [[0.10, 0.45, 0.25], [0.85, 0.80, 0.30], [0.80, 0.20, 0.12]]);
    let eye = paint(Pattern::Plaster, 0.05, [[0.02, 0.02, 0.02], [0.05, 0.05, 0.06], [0.9, 0.9, 0.9]]);
    let sphere = |radius: f64| Form::Sphere { radius };
    let ear = Form::Torus { major: 0.13, minor: 0.056 };
    let upright = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let solid = Solid::new(vec![
        part(sphere(0.37), [0.0, 0.0, 0.0], fur),
        part(sphere(0.21), [0.0, -0.25, -0.11], skin),
        part(sphere(0.07), [-0.14, -0.32, 0.11], eye),
        part(sphere(0.07), [0.14, -0.32, 0.11], eye),
        Part { turn: upright, ..part(ear, [-0.44, 0.0, 0.10], skin) },
        Part { turn: upright, ..part(ear, [0.44, 0.0, 0.10], skin) },
        part(Form::Torus { major: 0.31, minor: 0.09 }, [0.0, 0.0, -0.34], ring),
        part(Form::Cuboid { half: DVec3::new(0.15, 0.15, 0.10) }, [0.0, 0.02, 0.42], ring),
    ]);
    // The bend's angle and the spin are the same function of time: the face keeps its position on the bend.
    let (rate, acceleration, middle) = (1.5, 1.9, -std::f64::consts::FRAC_PI_2);
    let path = Path::Orbit { centre: DVec3::new(-0.08, 0.72, 0.70), radius: 0.80, start: middle, rate, acceleration };
    MovingObject { name: "monkey", solid, motion: motion(path, [0.0, 0.0, 1.0], rate, acceleration) }
}

/// A ball that falls, touches the floor once and comes up again.
fn sphere(paint: &mut Paint) -> MovingObject {
    let texture = paint(Pattern::Ball, 0.06, [[0.75, 0.08, 0.06], [0.10, 0.30, 0.65], [0.85, 0.65, 0.10]]);
    let radius = 0.33;
    let solid = Solid::new(vec![part(Form::Sphere { radius }, [0.0; 3], texture)]);
    let bounce = Bounce { height: 0.72, fall: 0.46, contact: 0.05, touch: 0.04 };
    let centre = DVec3::new(0.05, -0.1, radius);
    let path = Path::Bounce { centre, swing: DVec3::new(0.55, 0.25, 0.0), rate: 1.6, bounce };
    let mut motion = motion(path, [0.3, 1.0, 0.2], 1.3, 0.0);
    motion.orientation = DQuat::from_rotation_x(0.5);
    MovingObject { name: "sphere", solid, motion }
}

/// A box on the left and a bumpy ball on the right, which turn about other axes at other rates.
fn pair(paint: &mut Paint) -> Vec<MovingObject> {
    let tiles = paint(Pattern::Mosaic, 0.10, [[0.12, 0.42, 0.38], [0.86, 0.80, 0.62], [0.70, 0.26, 0.10]]);
    let skin = paint(Pattern::Skin, 0.10, [[0.20, 0.06, 0.28], [0.62, 0.24, 0.52], [0.88, 0.78, 0.60]]);
    let cuboid = Solid::new(vec![part(Form::Cuboid { half: DVec3::splat(0.25) }, [0.0; 3], tiles)]);
    let bumpy = Solid::new(vec![part(Form::Bumpy { radius: 0.34, relief: 0.05 }, [0.0; 3], skin)]);
    let left = Path::Sway { centre: DVec3::new(-0.72, 0.0, 0.72), swing: DVec3::new(0.30, 0.25, 0.24), rate: 2.3 };
    let right = Path::Sway { centre: DVec3::new(0.74, 0.05, 0.62), swing: DVec3::new(0.26, -0.30, -0.12), rate: 1.9 };
    vec![
        MovingObject { name: "box", solid: cuboid, motion: motion(left, [0.3, 0.1, 1.0], 2.2, 0.0) },
        MovingObject { name: "bumpy", solid: bumpy, motion: motion(right, [-0.2, 0.3, -1.0], 2.4, 0.0) },
    ]
}

/// Floor, back wall, side walls, and the wall behind the cameras.
fn room(world: World, paint: &mut Paint) -> Vec<Plane> {
    let (half, back, front) = ROOM;
    let (floor, wall) = match world {
        World::Cube => (
            paint(Pattern::Planks, 0.16, [[0.36, 0.20, 0.09], [0.55, 0.36, 0.18], [0.20, 0.11, 0.05]]),
            paint(Pattern::Plaster, 0.35, [[0.42, 0.50, 0.48], [0.62, 0.66, 0.60], [0.25, 0.32, 0.34]]),
        ),
        World::Lychee | World::Pair => (
            paint(Pattern::Mosaic, 0.31, [[0.50, 0.48, 0.42], [0.24, 0.30, 0.36], [0.62, 0.55, 0.40]]),
            paint(Pattern::Bricks, 0.46, [[0.30, 0.38, 0.30], [0.48, 0.52, 0.40], [0.20, 0.24, 0.20]]),
        ),
        World::Monkey => (
            paint(Pattern::Plaster, 0.28, [[0.26, 0.34, 0.12], [0.44, 0.46, 0.22], [0.55, 0.48, 0.30]]),
            paint(Pattern::Bricks, 0.34, [[0.46, 0.16, 0.10], [0.60, 0.30, 0.18], [0.62, 0.58, 0.52]]),
        ),
        World::Sphere => (
            paint(Pattern::Planks, 0.21, [[0.36, 0.38, 0.42], [0.58, 0.56, 0.52], [0.22, 0.22, 0.24]]),
            paint(Pattern::Mosaic, 0.42, [[0.58, 0.52, 0.40], [0.40, 0.50, 0.52], [0.62, 0.44, 0.36]]),
        ),
    };
    let plane = |normal: DVec3, offset: f64, texture: Texture| Plane { normal, offset, reach: f64::INFINITY, texture };
    vec![
        plane(DVec3::Z, 0.0, floor),
        plane(-DVec3::Y, -back, wall),
        plane(DVec3::X, -half, Texture { salt: wall.salt ^ 1, ..wall }),
        plane(-DVec3::X, -half, Texture { salt: wall.salt ^ 2, ..wall }),
        plane(DVec3::Y, front, wall),
    ]
}

/// Static objects around the moving objects' paths, none in them.
fn distractors(world: World, paint: &mut Paint) -> Vec<(DVec3, Part)> {
    let wood = paint(Pattern::Planks, 0.10, [[0.45, 0.24, 0.08], [0.58, 0.38, 0.16], [0.22, 0.10, 0.04]]);
    let blue = paint(Pattern::Plaster, 0.13, [[0.08, 0.20, 0.50], [0.20, 0.42, 0.66], [0.75, 0.75, 0.72]]);
    let tiles = paint(Pattern::Mosaic, 0.11, [[0.60, 0.20, 0.14], [0.75, 0.68, 0.52], [0.18, 0.30, 0.24]]);
    let striped = paint(Pattern::Fur, 0.17, [[0.62, 0.50, 0.14], [0.16, 0.24, 0.30], [0.80, 0.76, 0.66]]);
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let still = |position: DVec3, form: Form, texture: Texture| (position, part(form, [0.0; 3], texture));
    let cuboid = |x: f64, y: f64, z: f64| Form::Cuboid { half: DVec3::new(x, y, z) };
    let ball = |radius: f64| Form::Sphere { radius };
    let ring = Form::Torus { major: 0.26, minor: 0.09 };
    match world {
        World::Cube => vec![
            still(at(-1.35, 1.2, 0.40), cuboid(0.28, 0.28, 0.40), blue),
            still(at(1.45, 1.35, 0.32), ball(0.32), striped),
            still(at(0.15, 1.75, 0.55), cuboid(0.35, 0.22, 0.55), tiles),
            still(at(0.9, -0.75, 0.09), ring, wood),
        ],
        World::Lychee | World::Pair => vec![
            still(at(-1.35, 1.0, 0.30), cuboid(0.30, 0.30, 0.30), wood),
            still(at(-1.35, 1.0, 0.84), ball(0.24), blue),
            still(at(1.35, 0.9, 0.50), cuboid(0.24, 0.24, 0.50), striped),
            still(at(0.1, 1.6, 0.34), ball(0.34), tiles),
        ],
        World::Monkey => vec![
            still(at(-1.5, 1.1, 0.34), ball(0.34), tiles),
            still(at(1.6, 1.5, 0.55), cuboid(0.26, 0.26, 0.55), wood),
            still(at(-0.1, 1.35, 0.50), cuboid(0.20, 0.20, 0.50), blue),
            still(at(-0.85, -0.80, 0.09), ring, striped),
        ],
        World::Sphere => vec![
            still(at(-1.2, 1.2, 0.45), cuboid(0.30, 0.30, 0.45), striped),
            still(at(1.3, 1.1, 0.28), cuboid(0.36, 0.28, 0.28), wood),
            still(at(1.3, 1.1, 0.80), ball(0.24), tiles),
            still(at(-0.8, -0.8, 0.09), ring, blue),
        ],
    }
}
