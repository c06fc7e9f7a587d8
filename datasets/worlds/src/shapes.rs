//! The shapes of the synthetic worlds: where a ray meets them, what they are painted with, and points on them.

use std::f64::consts::TAU;

use glam::DVec3;
use rand::Rng;

use crate::tracer::shape::{Crossing, Ray, SKIN};

/// A surface, in metres.
#[derive(Clone, Copy)]
pub(super) enum Shape {
    Sphere {
        centre: DVec3,
        radius: f64,
    },
    /// Axis-aligned.
    Cuboid {
        centre: DVec3,
        half: DVec3,
    },
    /// Level, seen from above; the floor.
    Disc {
        centre: DVec3,
        radius: f64,
    },
}

impl Shape {
    /// The nearest crossing in front of the ray's origin.
    pub fn intersect(&self, ray: &Ray) -> Option<Crossing> {
        match *self {
            Self::Sphere { centre, radius } => {
                let to_origin = ray.origin - centre;
                let half_b = to_origin.dot(ray.direction);
                let root = half_b * half_b - to_origin.length_squared() + radius * radius;
                if root < 0.0 {
                    return None;
                }
                let near = -half_b - root.sqrt();
                let t = if near > SKIN { near } else { -half_b + root.sqrt() };
                (t > SKIN).then(|| Crossing { t, normal: (ray.at(t) - centre) / radius })
            }
            Self::Cuboid { centre, half } => {
                let inverse = ray.direction.recip();
                let (a, b) = ((centre - half - ray.origin) * inverse, (centre + half - ray.origin) * inverse);
                let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
                if enter > leave || enter <= SKIN {
                    return None;
                }
                let local = (ray.at(enter) - centre) / half;
                let side = local.abs();
                let axis = if side.x >= side.y && side.x >= side.z {
                    DVec3::X
                } else if side.y >= side.z {
                    DVec3::Y
                } else {
                    DVec3::Z
                };
                Some(Crossing { t: enter, normal: axis * local.dot(axis).signum() })
            }
            Self::Disc { centre, radius } => {
                let t = (centre.z - ray.origin.z) / ray.direction.z;
                let inside = t.is_finite() && t > SKIN && ray.at(t).distance_squared(centre) <= radius * radius;
                inside.then_some(Crossing { t, normal: DVec3::Z })
            }
        }
    }

    /// Surface, square metres.
    pub fn area(&self) -> f64 {
        match *self {
            Self::Sphere { radius, .. } => 2.0 * TAU * radius * radius,
            Self::Cuboid { half, .. } => 8.0 * (half.x * half.y + half.y * half.z + half.z * half.x),
            Self::Disc { radius, .. } => 0.5 * TAU * radius * radius,
        }
    }

    /// A point on the surface, evenly distributed, with its normal.
    pub fn sample(&self, rng: &mut impl Rng) -> (DVec3, DVec3) {
        match *self {
            Self::Sphere { centre, radius } => {
                let (z, turn) = (rng.random_range(-1.0..1.0_f64), rng.random_range(0.0..TAU));
                let flat = (1.0 - z * z).sqrt();
                let normal = DVec3::new(flat * turn.cos(), flat * turn.sin(), z);
                (centre + radius * normal, normal)
            }
            Self::Cuboid { centre, half } => {
                let faces = [half.y * half.z, half.z * half.x, half.x * half.y];
                let mut pick = rng.random_range(0.0..faces.iter().sum::<f64>());
                let mut axis = 2;
                for (i, face) in faces.iter().enumerate() {
                    if pick < *face {
                        axis = i;
                        break;
                    }
                    pick -= face;
                }
                let mut local = DVec3::from_array(std::array::from_fn(|_| rng.random_range(-1.0..1.0)));
                local[axis] = if rng.random_bool(0.5) { 1.0 } else { -1.0 };
                let mut normal = DVec3::ZERO;
                normal[axis] = local[axis];
                (centre + local * half, normal)
            }
            Self::Disc { centre, radius } => {
                let (r, turn) = (radius * rng.random::<f64>().sqrt(), rng.random_range(0.0..TAU));
                (centre + DVec3::new(r * turn.cos(), r * turn.sin(), 0.0), DVec3::Z)
            }
        }
    }
}

/// Paint: two colours (linear light, 0 to 1) in a pattern.
#[derive(Clone, Copy)]
pub(super) struct Paint {
    pub pattern: Pattern,
    pub colors: [DVec3; 2],
}

/// The regions of the second colour.
#[derive(Clone, Copy)]
pub(super) enum Pattern {
    /// Squares of this side, metres, seen from above.
    Checker(f64),
    /// Cubes of this side, metres.
    Blocks(f64),
    /// Soft level bands, this many a metre.
    Bands(f64),
    /// Soft swirls, this many a metre.
    Swirls(f64),
}

impl Paint {
    /// The colour at a place on the surface, given relative to the shape's centre.
    pub fn color(&self, local: DVec3) -> DVec3 {
        let parity = |cells: DVec3| (cells.x + cells.y + cells.z).rem_euclid(2.0);
        let share = match self.pattern {
            Pattern::Checker(side) => parity((local.with_z(0.0) / side).floor()),
            // Half a cell off, so that a cell lies in the middle of each face.
            Pattern::Blocks(side) => parity((local / side + 0.5).floor()),
            Pattern::Bands(count) => 0.5 + 0.5 * (TAU * count * local.z).sin(),
            Pattern::Swirls(count) => {
                let bent = local.x + 0.35 * (9.0 * local.y).sin() / count + 0.5 * local.z;
                0.5 + 0.5 * (TAU * count * bent).sin()
            }
        };
        self.colors[0].lerp(self.colors[1], share)
    }
}
