//! The room: walls, furniture at rest, and four bodies that move. Units are metres; z is up.

use glam::DVec3;

use super::super::tracer::solid::Form;
use super::super::tracer::stage::{Lamp, Plane};
use super::super::tracer::texture::Pattern;
use super::objects::{Bodies, Paint, at_rest, ball, cuboid, line, moving, part, spin, swinging, turning};

/// Distance of the walls from the middle, and height of the ceiling, metres.
const HALF: f64 = 3.0;
const HEIGHT: f64 = 3.0;

/// A round lamp below the ceiling.
pub(super) fn lamp() -> Lamp {
    Lamp::new(DVec3::new(0.4, -0.6, 2.9), 0.4)
}

/// Floor, four walls and ceiling.
pub(super) fn planes(paint: &mut Paint) -> Vec<Plane> {
    let floor = paint(Pattern::Planks, 0.24, [[0.40, 0.24, 0.12], [0.62, 0.42, 0.24], [0.22, 0.13, 0.07]]);
    let walls = [
        paint(Pattern::Bricks, 0.52, [[0.52, 0.24, 0.16], [0.66, 0.38, 0.24], [0.70, 0.66, 0.58]]),
        paint(Pattern::Plaster, 0.50, [[0.46, 0.56, 0.58], [0.66, 0.72, 0.68], [0.28, 0.36, 0.42]]),
        paint(Pattern::Mosaic, 0.60, [[0.62, 0.58, 0.42], [0.40, 0.52, 0.50], [0.66, 0.46, 0.36]]),
        paint(Pattern::Fur, 0.70, [[0.40, 0.50, 0.34], [0.58, 0.62, 0.46], [0.72, 0.70, 0.60]]),
    ];
    let ceiling = paint(Pattern::Plaster, 0.60, [[0.62, 0.62, 0.60], [0.74, 0.73, 0.70], [0.50, 0.50, 0.50]]);
    let inward = [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y];
    let plane = |normal: DVec3, offset: f64, texture| Plane { normal, offset, reach: f64::INFINITY, texture };
    let mut planes = vec![plane(DVec3::Z, 0.0, floor), plane(-DVec3::Z, -HEIGHT, ceiling)];
    planes.extend(inward.into_iter().zip(walls).map(|(normal, texture)| plane(normal, -HALF, texture)));
    planes
}

/// A table with a ball and a crate at rest; a sliding box, a spinning top, a pendulum and a rising box.
pub(super) fn bodies(paint: &mut Paint) -> Bodies {
    let wood = paint(Pattern::Planks, 0.12, [[0.46, 0.26, 0.12], [0.70, 0.48, 0.26], [0.26, 0.14, 0.06]]);
    let crate_paint = paint(Pattern::Mosaic, 0.16, [[0.16, 0.42, 0.40], [0.84, 0.78, 0.60], [0.66, 0.26, 0.10]]);
    let skin = paint(Pattern::Ball, 0.06, [[0.80, 0.62, 0.10], [0.08, 0.25, 0.60], [0.85, 0.83, 0.78]]);
    let red = paint(Pattern::Mosaic, 0.14, [[0.80, 0.12, 0.08], [0.90, 0.60, 0.16], [0.92, 0.88, 0.78]]);
    let blue = paint(Pattern::Fur, 0.14, [[0.06, 0.22, 0.60], [0.16, 0.56, 0.70], [0.88, 0.88, 0.84]]);
    let green = paint(Pattern::Skin, 0.12, [[0.08, 0.42, 0.16], [0.54, 0.66, 0.16], [0.90, 0.84, 0.44]]);
    let violet = paint(Pattern::Bricks, 0.20, [[0.36, 0.14, 0.50], [0.62, 0.40, 0.70], [0.86, 0.80, 0.88]]);
    let mut table =
        vec![part(cuboid(0.50, 0.32, 0.04), [0.0, 0.0, 0.52], wood), part(ball(0.18), [0.1, 0.0, 0.74], skin)];
    for (x, y) in [(-0.44, -0.26), (-0.44, 0.26), (0.44, -0.26), (0.44, 0.26)] {
        table.push(part(cuboid(0.04, 0.04, 0.24), [x, y, 0.24], wood));
    }
    let still = vec![
        at_rest([0.0, 0.15, 0.0], table),
        at_rest([-1.25, 0.75, 0.0], vec![part(cuboid(0.28, 0.28, 0.28), [0.0, 0.0, 0.28], crate_paint)]),
    ];
    let slide = line([-1.15, -0.95, 0.25], [2.0, 0.15, 0.0], [-1.2, 0.0, 0.0]);
    let top = vec![
        part(Form::Torus { major: 0.24, minor: 0.09 }, [0.0; 3], green),
        part(cuboid(0.33, 0.05, 0.05), [0.0; 3], red),
        part(ball(0.12), [0.0, 0.0, 0.20], blue),
        part(cuboid(0.04, 0.04, 0.16), [0.0, 0.0, -0.16], wood),
    ];
    let bob = vec![part(ball(0.22), [0.0; 3], skin), part(cuboid(0.025, 0.025, 0.62), [0.0, 0.0, 0.82], wood)];
    let rise = turning(line([0.95, 1.0, 0.35], [0.0, 0.0, 0.5], [0.0, 0.0, 0.9]), [0.0, 0.0, 1.0], 0.8, 0.0);
    let moving = vec![
        moving("box", vec![part(cuboid(0.30, 0.22, 0.25), [0.0; 3], red)], slide),
        moving("top", top, spin([1.15, -0.10, 0.32], [0.0, 0.0, 1.0], 5.0, 0.0)),
        moving("bob", bob, swinging([-0.35, 0.95, 2.90], [0.5, 1.0, 0.0], 1.45, 0.45, 1.4, 0.7)),
        moving("lift", vec![part(cuboid(0.26, 0.26, 0.30), [0.0; 3], violet)], rise),
    ];
    Bodies { still, moving }
}
