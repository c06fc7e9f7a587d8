//! Vehicles, people, trees and houses: parts around an origin on the ground, x ahead, y to the left, z up.

use glam::{DVec2, DVec3};
use gs_driving::ObjectClass;

use super::paint::Paint;
use crate::tracer::shape::Shape;
use crate::tracer::solid::{self, Solid};

/// A painted shape.
pub(super) type Part = solid::Part<Paint>;

/// A rigid thing.
#[derive(Debug, Clone)]
pub(super) struct Body {
    pub solid: Solid<Paint>,
    /// Corners of the box around all parts.
    pub low: DVec3,
    pub high: DVec3,
    /// The label that PandaSet would give it.
    pub label: &'static str,
    /// Its number in PandaSet's semantic classes.
    pub semantic: u8,
    pub salt: u32,
}

impl Body {
    fn new(label: &'static str, semantic: u8, salt: u32, parts: Vec<Part>) -> Self {
        let (mut low, mut high) = (DVec3::splat(f64::INFINITY), DVec3::splat(f64::NEG_INFINITY));
        for part in &parts {
            let half = part.shape.half();
            (low, high) = (low.min(part.position - half), high.max(part.position + half));
        }
        Self { solid: Solid::new(parts), low, high, label, semantic, salt }
    }

    /// The class for evaluation.
    pub fn class(&self) -> ObjectClass {
        ObjectClass::of_label(self.label)
    }

    /// Length, width and height, metres.
    pub fn size(&self) -> DVec3 {
        self.high - self.low
    }
}

fn cuboid(centre: [f64; 3], size: [f64; 3], paint: Paint) -> Part {
    Part::new(Shape::Cuboid { half: 0.5 * DVec3::from(size) }, centre.into(), paint)
}

fn ball(centre: [f64; 3], radius: f64, paint: Paint) -> Part {
    Part::new(Shape::Sphere { radius }, centre.into(), paint)
}

/// A column that stands on the ground.
fn column(centre: [f64; 3], radius: f64, paint: Paint) -> Part {
    Part::new(Shape::Column { radius, half_height: centre[2] }, centre.into(), paint)
}

fn dark() -> Paint {
    Paint::Plain { color: DVec3::splat(0.025), grain: 0.2 }
}

fn wheels(length: f64, width: f64, radius: f64) -> impl Iterator<Item = Part> {
    let places = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
    places.into_iter().map(move |(x, y)| {
        let centre = [x * 0.31 * length, y * (0.5 * width - 0.1), radius];
        cuboid(centre, [2.0 * radius, 0.2, 2.0 * radius], dark())
    })
}

/// A car of this length; width and height follow.
pub(super) fn car(color: DVec3, length: f64, salt: u32) -> Body {
    let (width, height) = (0.36 * length + 0.2, 1.3 + 0.04 * length);
    let waist = 0.55 * height;
    let painted = Paint::Bodywork { color, half_length: 0.5 * length };
    let mut parts = vec![
        cuboid([0.0, 0.0, 0.5 * (waist + 0.22)], [length, width, waist - 0.22], painted),
        cuboid(
            [-0.06 * length, 0.0, 0.5 * (waist + height) - 0.04],
            [0.52 * length, 0.86 * width, height - waist - 0.08],
            Paint::Glass,
        ),
        cuboid([-0.06 * length, 0.0, height - 0.04], [0.46 * length, 0.84 * width, 0.08], painted),
    ];
    parts.extend(wheels(length, width, 0.33));
    Body::new("Car", 13, salt, parts)
}

/// A bus of this length.
pub(super) fn bus(color: DVec3, length: f64, salt: u32) -> Body {
    let painted = Paint::Bodywork { color, half_length: 0.5 * length };
    let mut parts = vec![
        cuboid([0.0, 0.0, 0.85], [length, 2.5, 1.0], painted),
        cuboid([0.0, 0.0, 1.85], [length - 0.1, 2.46, 1.0], Paint::Glass),
        cuboid([0.0, 0.0, 2.65], [length, 2.5, 0.6], painted),
    ];
    parts.extend(wheels(length, 2.5, 0.45));
    Body::new("Bus", 23, salt, parts)
}

fn person(color: DVec3, z: f64, lean: f64) -> Vec<Part> {
    let skin = Paint::Plain { color: DVec3::new(0.5, 0.32, 0.23), grain: 0.1 };
    let cloth = Paint::Plain { color, grain: 0.15 };
    vec![cuboid([lean, 0.0, z + 0.3], [0.28, 0.46, 0.62], cloth), ball([1.4 * lean, 0.0, z + 0.76], 0.14, skin)]
}

/// A person on foot.
pub(super) fn pedestrian(color: DVec3, salt: u32) -> Body {
    let legs = Paint::Plain { color: DVec3::new(0.04, 0.05, 0.09), grain: 0.1 };
    let mut parts = person(color, 0.82, 0.0);
    for (x, y) in [(0.1, 0.11), (-0.1, -0.11)] {
        parts.push(column([x, y, 0.42], 0.09, legs));
    }
    Body::new("Pedestrian", 30, salt, parts)
}

/// A person on a bicycle.
pub(super) fn cyclist(color: DVec3, salt: u32) -> Body {
    let frame = Paint::Plain { color: 0.6 * DVec3::new(color.z, color.x, color.y), grain: 0.2 };
    let mut parts = person(color, 0.9, 0.1);
    parts.push(cuboid([0.0, 0.0, 0.6], [1.0, 0.07, 0.12], frame));
    parts.push(cuboid([0.0, 0.0, 0.78], [0.25, 0.3, 0.35], dark()));
    parts.push(cuboid([0.5, 0.0, 0.95], [0.08, 0.5, 0.08], dark()));
    for x in [-0.52, 0.52] {
        parts.push(cuboid([x, 0.0, 0.34], [0.6, 0.06, 0.66], dark()));
    }
    Body::new("Bicycle", 26, salt, parts)
}

/// A tree; its crown has three balls.
pub(super) fn tree(height: f64, turn: f64, salt: u32) -> Body {
    let bark = Paint::Plain { color: DVec3::new(0.14, 0.1, 0.07), grain: 0.2 };
    let leaves = Paint::Foliage { color: DVec3::new(0.1, 0.24, 0.06) };
    let mut parts = vec![column([0.0, 0.0, 0.3 * height], 0.16, bark)];
    for (i, (share, radius)) in [(0.62, 0.24), (0.72, 0.21), (0.85, 0.18)].into_iter().enumerate() {
        let (sin, cos) = (turn + 2.1 * i as f64).sin_cos();
        let centre = [0.1 * height * cos, 0.1 * height * sin, share * height];
        parts.push(ball(centre, radius * height, leaves));
    }
    Body::new("Vegetation", 5, salt, parts)
}

/// A lamp post.
pub(super) fn post(salt: u32) -> Body {
    let steel = Paint::Plain { color: DVec3::splat(0.3), grain: 0.4 };
    let parts = vec![column([0.0, 0.0, 3.0], 0.09, steel), cuboid([0.0, 0.6, 6.0], [0.25, 1.4, 0.12], steel)];
    Body::new("Other Static Object", 42, salt, parts)
}

/// A house; its origin is the middle of its ground.
pub(super) fn house(size: DVec3, color: DVec3, window: DVec2, salt: u32) -> Body {
    let wall = Paint::Facade { color, window };
    let roof = Paint::Plain { color: 0.5 * color, grain: 0.6 };
    let parts = vec![
        cuboid([0.0, 0.0, 0.5 * size.z], size.to_array(), wall),
        cuboid([0.0, 0.0, size.z + 0.2], [size.x + 0.4, size.y + 0.4, 0.4], roof),
    ];
    Body::new("Building", 41, salt, parts)
}
