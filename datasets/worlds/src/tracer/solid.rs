//! Rigid objects: parts with a form and a texture, and where rays meet them.

use glam::{DQuat, DVec3};

use super::super::shapes::{Crossing, Ray, SKIN, Shape};
use super::motion::Pose;
use super::texture::{Texture, bumps};

/// A form around its own origin, metres.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Form {
    Sphere {
        radius: f64,
    },
    Cuboid {
        half: DVec3,
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

/// One painted form, placed and turned in its object.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Part {
    pub form: Form,
    pub position: DVec3,
    pub turn: DQuat,
    pub texture: Texture,
}

/// Parts that move together.
#[derive(Debug, Clone)]
pub(crate) struct Solid {
    pub parts: Vec<Part>,
    /// Radius of the sphere around the object's origin that contains all parts, metres.
    pub radius: f64,
}

/// The intersection of a ray with an object.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hit {
    pub t: f64,
    /// Outward, world.
    pub normal: DVec3,
    /// The part, and the position in its coordinates.
    pub part: usize,
    pub local: DVec3,
}

/// Crossings are found to this precision along the ray, metres: less than a hundredth of a pixel in any view.
const PRECISION: f64 = 1e-5;

/// The shortest step of a march, metres. Rays that graze a surface by less may miss it, by a hundredth of a pixel.
const STEP_MIN: f64 = 2e-4;

impl Form {
    /// Radius of the sphere around the origin that contains the form, metres.
    fn radius(&self) -> f64 {
        match *self {
            Self::Sphere { radius } => radius,
            Self::Cuboid { half } => half.length(),
            Self::Torus { major, minor } => major + minor,
            Self::Bumpy { radius, relief } => radius * (1.0 + relief),
        }
    }

    fn intersect(&self, ray: &Ray) -> Option<Crossing> {
        match *self {
            Self::Sphere { radius } => Shape::Sphere { centre: DVec3::ZERO, radius }.intersect(ray),
            Self::Cuboid { half } => Shape::Cuboid { centre: DVec3::ZERO, half }.intersect(ray),
            Self::Torus { .. } | Self::Bumpy { .. } => self.march(ray),
        }
    }

    /// About the distance to the surface, for forms without a short formula for crossings: below 0 inside.
    fn distance(&self, position: DVec3) -> f64 {
        match *self {
            Self::Torus { major, minor } => {
                let ring = position.truncate().length() - major;
                (ring * ring + position.z * position.z).sqrt() - minor
            }
            // The height above the relief.
            Self::Bumpy { radius, relief } => position.length() - radius * (1.0 + relief * bumps(position)),
            Self::Sphere { radius } => position.length() - radius,
            Self::Cuboid { half } => (position.abs() - half).max_element(),
        }
    }

    /// Steps along the ray by the distance to the surface, within the sphere that holds the form, until a step ends
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

    /// Whether the form stands in a ray's way before `limit`. Bumps are smaller than the lamp's half shadow blurs.
    fn blocks(&self, ray: &Ray, limit: f64) -> bool {
        let crossing = match *self {
            Self::Bumpy { radius, .. } => Self::Sphere { radius }.intersect(ray),
            _ => self.intersect(ray),
        };
        crossing.is_some_and(|crossing| crossing.t < limit)
    }
}

/// The distances at which a ray enters and leaves a sphere around the origin; `None` if it misses it or the sphere is behind it.
fn span(ray: &Ray, radius: f64) -> Option<(f64, f64)> {
    let half_b = ray.origin.dot(ray.direction);
    let root = half_b * half_b - ray.origin.length_squared() + radius * radius;
    if root < 0.0 {
        return None;
    }
    let root = root.sqrt();
    (root > half_b).then_some((-half_b - root, -half_b + root))
}

/// Whether a ray meets the sphere at all, in front of its origin.
fn may_meet(ray: &Ray, centre: DVec3, radius: f64) -> bool {
    span(&Ray { origin: ray.origin - centre, direction: ray.direction }, radius).is_some()
}

/// Whether the segment from `origin` to `origin + way` comes within `radius` of the coordinates' origin.
fn passes(origin: DVec3, way: DVec3, radius: f64) -> bool {
    let nearest = (-origin.dot(way) / way.length_squared()).clamp(0.0, 1.0);
    (origin + nearest * way).length_squared() <= radius * radius
}

fn to_local(ray: &Ray, rotation: DQuat, position: DVec3) -> Ray {
    let back = rotation.conjugate();
    Ray { origin: back * (ray.origin - position), direction: back * ray.direction }
}

impl Solid {
    pub fn new(parts: Vec<Part>) -> Self {
        let radius = parts.iter().map(|part| part.position.length() + part.form.radius()).fold(0.0, f64::max);
        Self { parts, radius }
    }

    /// The nearest crossing of a ray (world) with the object at `pose`.
    pub fn intersect(&self, ray: &Ray, pose: &Pose) -> Option<Hit> {
        if !may_meet(ray, pose.position, self.radius) {
            return None;
        }
        let ray = to_local(ray, pose.rotation, pose.position);
        let mut nearest: Option<Hit> = None;
        for (index, part) in self.parts.iter().enumerate() {
            if !may_meet(&ray, part.position, part.form.radius()) {
                continue;
            }
            let inner = to_local(&ray, part.turn, part.position);
            let Some(crossing) = part.form.intersect(&inner) else { continue };
            if nearest.is_none_or(|hit| crossing.t < hit.t) {
                let normal = pose.rotation * (part.turn * crossing.normal);
                nearest = Some(Hit { t: crossing.t, normal, part: index, local: inner.at(crossing.t) });
            }
        }
        nearest
    }

    /// Whether a part other than `except` stands between `origin` and `origin + way`, in the object's coordinates. A surface
    /// that a light shines on does not shade itself as long as its own form is round, which all forms nearly are.
    pub fn is_between(&self, origin: DVec3, way: DVec3, except: Option<usize>) -> bool {
        if self.parts.len() > 1 && !passes(origin, way, self.radius) {
            return false;
        }
        self.parts.iter().enumerate().any(|(index, part)| {
            let from = origin - part.position;
            if except == Some(index) || !passes(from, way, part.form.radius()) {
                return false;
            }
            let distance = way.length();
            let ray = Ray { origin: from, direction: way / distance };
            let is_turned = part.turn != DQuat::IDENTITY;
            part.form.blocks(&if is_turned { to_local(&ray, part.turn, DVec3::ZERO) } else { ray }, distance)
        })
    }

    /// The first position along a ray, in steps from `from` to `to`, that is inside the object.
    #[cfg(test)]
    pub fn walk(&self, ray: &Ray, pose: &Pose, from: f64, to: f64, step: f64) -> Option<f64> {
        let count = ((to - from) / step) as usize;
        (0..count).map(|i| from + i as f64 * step).find(|t| {
            let position = pose.rotation.conjugate() * (ray.at(*t) - pose.position);
            self.parts.iter().any(|part| part.form.distance(part.turn.conjugate() * (position - part.position)) < 0.0)
        })
    }

    /// The height of the object's lowest point at `pose`, by the balls around its parts or, for a lone box, its corners.
    #[cfg(test)]
    pub fn lowest(&self, pose: &Pose) -> f64 {
        let bottom = |part: &Part| {
            let height = (pose.position + pose.rotation * part.position).z;
            let down = (pose.rotation * part.turn).conjugate() * -DVec3::Z;
            height
                - match part.form {
                    Form::Cuboid { half } => half.dot(down.abs()),
                    Form::Torus { major, minor } => major * down.truncate().length() + minor,
                    form => form.radius(),
                }
        };
        self.parts.iter().map(bottom).fold(f64::MAX, f64::min)
    }
}
