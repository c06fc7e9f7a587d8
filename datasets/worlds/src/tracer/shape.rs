//! Shapes around their own origin, and where rays meet them.

use glam::{DQuat, DVec3};
use serde::Deserialize;

use super::texture::bumps;
use super::vector::vector;

/// A half line; `direction` has length 1.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ray {
    pub origin: DVec3,
    pub direction: DVec3,
}

impl Ray {
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }

    /// The ray in the coordinates of a body at `position` with `rotation`.
    pub fn local(&self, rotation: DQuat, position: DVec3) -> Self {
        let back = rotation.conjugate();
        Self { origin: back * (self.origin - position), direction: back * self.direction }
    }
}

/// A distance along a ray, and the outward normal there.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Crossing {
    pub t: f64,
    pub normal: DVec3,
}

/// Rays start this far off a surface, metres, so that rounding does not make it shade itself.
pub(crate) const SKIN: f64 = 1e-6;

/// Crossings are found to this precision along the ray, metres: less than a hundredth of a pixel in any view.
const PRECISION: f64 = 1e-5;

/// The shortest step of a march, metres. Rays that graze a surface by less may miss it, by a hundredth of a pixel.
const STEP_MIN: f64 = 2e-4;

/// A shape around its own origin, metres.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub(crate) enum Shape {
    Sphere {
        radius: f64,
    },
    Cuboid {
        #[serde(deserialize_with = "vector")]
        half: DVec3,
    },
    /// Upright, closed above.
    Column {
        radius: f64,
        half_height: f64,
    },
    /// Around the z axis: circles of radius `minor` around a circle of radius `major`.
    Torus {
        major: f64,
        minor: f64,
    },
    /// A sphere whose radius varies by the share `relief` with [`bumps`].
    Bumpy {
        radius: f64,
        relief: f64,
    },
}

impl Shape {
    /// Radius of the sphere around the origin that contains the shape, metres.
    pub fn radius(&self) -> f64 {
        match *self {
            Self::Sphere { radius } => radius,
            Self::Cuboid { half } => half.length(),
            Self::Column { radius, half_height } => radius.hypot(half_height),
            Self::Torus { major, minor } => major + minor,
            Self::Bumpy { radius, relief } => radius * (1.0 + relief),
        }
    }

    /// Half the sides of the upright box around the shape, metres.
    pub fn half(&self) -> DVec3 {
        match *self {
            Self::Cuboid { half } => half,
            Self::Column { radius, half_height } => DVec3::new(radius, radius, half_height),
            Self::Torus { major, minor } => DVec3::new(major + minor, major + minor, minor),
            Self::Sphere { .. } | Self::Bumpy { .. } => DVec3::splat(self.radius()),
        }
    }

    /// The nearest crossing in front of the ray's origin; of boxes and columns only from outside.
    pub fn intersect(&self, ray: &Ray) -> Option<Crossing> {
        match *self {
            Self::Sphere { radius } => sphere(ray, radius),
            Self::Cuboid { half } => cuboid(ray, half),
            Self::Column { radius, half_height } => column(ray, radius, half_height),
            Self::Torus { .. } | Self::Bumpy { .. } => self.march(ray),
        }
    }

    /// Whether the shape stands in a ray's way before `limit`. Bumps are smaller than the lamp's half shadow blurs.
    pub fn blocks(&self, ray: &Ray, limit: f64) -> bool {
        let crossing = match *self {
            Self::Bumpy { radius, .. } => sphere(ray, radius),
            _ => self.intersect(ray),
        };
        crossing.is_some_and(|crossing| crossing.t < limit)
    }

    /// About the distance to the surface, for shapes without a short formula for crossings: below 0 inside.
    pub fn distance(&self, position: DVec3) -> f64 {
        match *self {
            Self::Torus { major, minor } => {
                let ring = position.truncate().length() - major;
                (ring * ring + position.z * position.z).sqrt() - minor
            }
            // The height above the relief.
            Self::Bumpy { radius, relief } => position.length() - radius * (1.0 + relief * bumps(position)),
            Self::Sphere { radius } => position.length() - radius,
            Self::Cuboid { half } => (position.abs() - half).max_element(),
            Self::Column { radius, half_height } => {
                (position.truncate().length() - radius).max(position.z.abs() - half_height)
            }
        }
    }

    /// Steps along the ray by the distance to the surface, within the sphere that holds the shape, until a step ends
    /// inside. Steps shrink towards a surface, so that one over a relief, where heights overestimate distances, passes
    /// nothing of a pixel's size.
    fn march(&self, ray: &Ray) -> Option<Crossing> {
        let (enter, leave) = span(ray, self.radius())?;
        let mut outside = enter.max(SKIN);
        let mut height = self.distance(ray.at(outside));
        while height > 0.0 {
            let next = outside + height.max(STEP_MIN);
            if next > leave {
                return None;
            }
            let next_height = self.distance(ray.at(next));
            if next_height <= 0.0 {
                outside = self.crossing(ray, (outside, height), (next, next_height));
                break;
            }
            (outside, height) = (next, next_height);
        }
        Some(Crossing { t: outside, normal: self.slope(ray.at(outside)) })
    }

    /// The crossing between a position outside and one inside: false position, which halves the weight of an end that
    /// stays (Illinois), so that both ends close in.
    fn crossing(&self, ray: &Ray, mut outside: (f64, f64), mut inside: (f64, f64)) -> f64 {
        let mut last = 0.0;
        while inside.0 - outside.0 > PRECISION {
            let t = outside.0 + (inside.0 - outside.0) * outside.1 / (outside.1 - inside.1);
            let height = self.distance(ray.at(t));
            if height.abs() < 0.1 * PRECISION {
                return t;
            }
            if height > 0.0 {
                outside = (t, height);
                inside.1 *= if last > 0.0 { 0.5 } else { 1.0 };
            } else {
                inside = (t, height);
                outside.1 *= if last < 0.0 { 0.5 } else { 1.0 };
            }
            last = height;
        }
        outside.0
    }

    /// The outward normal: the direction in which the distance grows, by differences to the corners of a tetrahedron.
    fn slope(&self, position: DVec3) -> DVec3 {
        const STEP: f64 = 1e-5;
        const CORNERS: [DVec3; 4] = [
            DVec3::new(1.0, -1.0, -1.0),
            DVec3::new(-1.0, 1.0, -1.0),
            DVec3::new(-1.0, -1.0, 1.0),
            DVec3::new(1.0, 1.0, 1.0),
        ];
        let along = CORNERS.map(|corner| corner * self.distance(position + STEP * corner));
        along.into_iter().sum::<DVec3>().normalize_or(DVec3::Z)
    }
}

fn sphere(ray: &Ray, radius: f64) -> Option<Crossing> {
    let (near, far) = roots(ray, radius)?;
    let t = if near > SKIN { near } else { far };
    (t > SKIN).then(|| Crossing { t, normal: ray.at(t) / radius })
}

fn cuboid(ray: &Ray, half: DVec3) -> Option<Crossing> {
    let inverse = ray.direction.recip();
    let (a, b) = ((-half - ray.origin) * inverse, (half - ray.origin) * inverse);
    let (enter, leave) = (a.min(b).max_element(), a.max(b).min_element());
    if enter > leave || enter <= SKIN {
        return None;
    }
    let local = ray.at(enter) / half;
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

fn column(ray: &Ray, radius: f64, half_height: f64) -> Option<Crossing> {
    let (o, d) = (ray.origin, ray.direction);
    let flat = d.truncate().length_squared();
    let b = o.truncate().dot(d.truncate());
    let root = b * b - flat * (o.truncate().length_squared() - radius * radius);
    if root > 0.0 && flat > 0.0 {
        let t = (-b - root.sqrt()) / flat;
        let p = ray.at(t);
        if t > SKIN && p.z.abs() <= half_height {
            return Some(Crossing { t, normal: (p.truncate() / radius).extend(0.0) });
        }
    }
    let t = (half_height - o.z) / d.z;
    let is_top = t.is_finite() && t > SKIN && d.z < 0.0 && ray.at(t).truncate().length_squared() <= radius * radius;
    is_top.then_some(Crossing { t, normal: DVec3::Z })
}

/// The distances at which the line of a ray crosses a sphere around the origin.
fn roots(ray: &Ray, radius: f64) -> Option<(f64, f64)> {
    let half_b = ray.origin.dot(ray.direction);
    let root = half_b * half_b - ray.origin.length_squared() + radius * radius;
    (root >= 0.0).then(|| (-half_b - root.sqrt(), -half_b + root.sqrt()))
}

/// The distances at which a ray enters and leaves a sphere around the origin; `None` if the sphere is not ahead of it.
pub(crate) fn span(ray: &Ray, radius: f64) -> Option<(f64, f64)> {
    roots(ray, radius).filter(|(_, leave)| *leave > 0.0)
}

/// Whether the segment from `origin` to `origin + way` comes within `radius` of the coordinates' origin.
pub(crate) fn passes(origin: DVec3, way: DVec3, radius: f64) -> bool {
    let nearest = (-origin.dot(way) / way.length_squared()).clamp(0.0, 1.0);
    (origin + nearest * way).length_squared() <= radius * radius
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_meet_shapes_from_outside() {
        let ray = Ray { origin: DVec3::new(-5.0, 0.2, 0.1), direction: DVec3::X };
        let column = Shape::Column { radius: 1.0, half_height: 1.0 };
        let cases = [
            (Shape::Cuboid { half: DVec3::ONE }, 4.0),
            (Shape::Sphere { radius: 1.0 }, 5.0 - (1.0_f64 - 0.05).sqrt()),
            (column, 5.0 - (1.0_f64 - 0.04).sqrt()),
        ];
        for (shape, expected) in cases {
            let crossing = shape.intersect(&ray).expect("a crossing");
            assert!((crossing.t - expected).abs() < 1e-12 && crossing.normal.x < -0.9, "{shape:?}: {crossing:?}");
            assert!(shape.intersect(&Ray { direction: -DVec3::X, ..ray }).is_none(), "behind: {shape:?}");
        }
        let inside = Ray { origin: DVec3::new(0.1, 0.1, 0.1), ..ray };
        let far = Shape::Sphere { radius: 1.0 }.intersect(&inside).expect("the far side");
        assert!((far.t - (0.98_f64.sqrt() - 0.1)).abs() < 1e-12 && far.normal.x > 0.9, "from inside: {far:?}");
        for shape in [Shape::Cuboid { half: DVec3::ONE }, column] {
            assert!(shape.intersect(&inside).is_none(), "from inside: {shape:?}");
        }
        let down = Ray { origin: DVec3::new(0.3, 0.0, 4.0), direction: -DVec3::Z };
        assert!(column.intersect(&down).is_some_and(|top| top.t == 3.0 && top.normal == DVec3::Z));
    }
}
