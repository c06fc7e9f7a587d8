//! Rigid bodies: painted parts, and where rays meet them.

use glam::{DQuat, DVec3};

use super::motion::Pose;
use super::shape::{Ray, Shape, passes, span};
use super::texture::Texture;

/// One painted shape, placed and turned in its body.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Part<P = Texture> {
    pub shape: Shape,
    pub position: DVec3,
    pub turn: DQuat,
    pub paint: P,
}

/// Parts that move together.
#[derive(Debug, Clone)]
pub(crate) struct Solid<P = Texture> {
    pub parts: Vec<Part<P>>,
    /// Radius of the sphere around the body's origin that contains all parts, metres.
    pub radius: f64,
}

/// The intersection of a ray with a body.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Hit {
    pub t: f64,
    /// Outward, in the coordinates of the ray.
    pub normal: DVec3,
    /// The part, and the position in its coordinates.
    pub part: usize,
    pub local: DVec3,
}

impl<P> Part<P> {
    /// The part in a body's coordinates, not turned.
    pub fn new(shape: Shape, position: DVec3, paint: P) -> Self {
        Self { shape, position, turn: DQuat::IDENTITY, paint }
    }

    fn is_turned(&self) -> bool {
        self.turn != DQuat::IDENTITY
    }
}

impl<P> Solid<P> {
    pub fn new(parts: Vec<Part<P>>) -> Self {
        let radius = parts.iter().map(|part| part.position.length() + part.shape.radius()).fold(0.0, f64::max);
        Self { parts, radius }
    }

    /// The nearest crossing of a ray (world) with the body at `pose`.
    pub fn intersect(&self, ray: &Ray, pose: &Pose) -> Option<Hit> {
        // Told before the ray is turned, since most rays pass most bodies.
        span(&Ray { origin: ray.origin - pose.position, direction: ray.direction }, self.radius)?;
        let hit = self.nearest(&ray.local(pose.rotation, pose.position))?;
        Some(Hit { normal: pose.rotation * hit.normal, ..hit })
    }

    /// The nearest crossing of a ray in the body's coordinates.
    pub fn nearest(&self, ray: &Ray) -> Option<Hit> {
        let mut nearest: Option<Hit> = None;
        for (index, part) in self.parts.iter().enumerate() {
            let from = Ray { origin: ray.origin - part.position, direction: ray.direction };
            if span(&from, part.shape.radius()).is_none() {
                continue;
            }
            let inner = if part.is_turned() { from.local(part.turn, DVec3::ZERO) } else { from };
            let Some(crossing) = part.shape.intersect(&inner) else { continue };
            if nearest.is_none_or(|hit| crossing.t < hit.t) {
                let normal = part.turn * crossing.normal;
                nearest = Some(Hit { t: crossing.t, normal, part: index, local: inner.at(crossing.t) });
            }
        }
        nearest
    }

    /// Whether a part other than `except` stands between `origin` and `origin + way`, in the body's coordinates. A
    /// surface that a light shines on does not shade itself as long as its own shape is round, which all shapes nearly
    /// are.
    pub fn is_between(&self, origin: DVec3, way: DVec3, except: Option<usize>) -> bool {
        if self.parts.len() > 1 && !passes(origin, way, self.radius) {
            return false;
        }
        self.parts.iter().enumerate().any(|(index, part)| {
            let from = origin - part.position;
            if except == Some(index) || !passes(from, way, part.shape.radius()) {
                return false;
            }
            let distance = way.length();
            let ray = Ray { origin: from, direction: way / distance };
            part.shape.blocks(&if part.is_turned() { ray.local(part.turn, DVec3::ZERO) } else { ray }, distance)
        })
    }

    /// The first position along a ray, in steps from `from` to `to`, that is inside the body.
    #[cfg(test)]
    pub fn walk(&self, ray: &Ray, pose: &Pose, from: f64, to: f64, step: f64) -> Option<f64> {
        let count = ((to - from) / step) as usize;
        (0..count).map(|i| from + i as f64 * step).find(|t| {
            let position = pose.rotation.conjugate() * (ray.at(*t) - pose.position);
            self.parts.iter().any(|part| part.shape.distance(part.turn.conjugate() * (position - part.position)) < 0.0)
        })
    }

    /// The height of the body's lowest point at `pose`, by the balls around its parts or, for a lone box, its corners.
    #[cfg(test)]
    pub fn lowest(&self, pose: &Pose) -> f64 {
        let bottom = |part: &Part<P>| {
            let height = (pose.position + pose.rotation * part.position).z;
            let down = (pose.rotation * part.turn).conjugate() * -DVec3::Z;
            height
                - match part.shape {
                    Shape::Cuboid { half } => half.dot(down.abs()),
                    Shape::Torus { major, minor } => major * down.truncate().length() + minor,
                    shape => shape.radius(),
                }
        };
        self.parts.iter().map(bottom).fold(f64::MAX, f64::min)
    }
}
