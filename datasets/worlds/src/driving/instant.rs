//! The street at a time: the nearest surface along a ray, its light and its motion.

use glam::{DVec2, DVec3};

use super::body::Part;
use super::paint::{Ground, Paint};
use super::street::{Street, Thing};
use crate::tracer::motion::Pose;
use crate::tracer::shape::{Ray, span};
use crate::tracer::solid;
use crate::tracer::texture::noise;

/// The ground begins and ends at these distances from a ray's origin, metres: it does not shade itself, and the rest is
/// haze.
const NEAR: f64 = 1e-4;
const FAR: f64 = 260.0;

/// Light of the sun and of the sky, linear.
const SUN: DVec3 = DVec3::new(2.1, 2.0, 1.8);
const SKY: DVec3 = DVec3::new(0.5, 0.56, 0.66);

/// A body at its pose.
#[derive(Debug, Clone, Copy)]
struct Placed<'s> {
    thing: &'s Thing,
    pose: Pose,
    /// A ball around it.
    centre: DVec3,
    radius: f64,
}

impl Placed<'_> {
    /// The nearest crossing of a ray with the body, in the body's axes, and the ray there.
    fn meet(&self, ray: &Ray) -> Option<(Ray, solid::Hit)> {
        span(&Ray { origin: ray.origin - self.centre, direction: ray.direction }, self.radius)?;
        let local = ray.local(self.pose.rotation, self.pose.position);
        Some((local, self.thing.body.solid.nearest(&local)?))
    }
}

/// A surface point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hit<'s> {
    /// Distance along the ray, metres.
    pub t: f64,
    pub position: DVec3,
    pub normal: DVec3,
    /// The thing and its painted part; `None`: the ground.
    pub on: Option<(&'s Thing, &'s Part)>,
    /// In the axes of the thing.
    local: DVec3,
    local_normal: DVec3,
}

/// The street at a time.
#[derive(Debug)]
pub(super) struct Instant<'s> {
    street: &'s Street,
    time: f64,
    placed: Vec<Placed<'s>>,
}

/// The things that a bundle of rays can meet.
#[derive(Debug, Clone, Default)]
pub(super) struct Candidates(Vec<u32>);

impl<'s> Instant<'s> {
    /// Everything where it is at `time`, seconds.
    pub fn new(street: &'s Street, time: f64) -> Self {
        let place = |thing: &'s Thing| {
            let pose = thing.path.at(time).pose();
            let centre = pose.position + pose.rotation * (0.5 * (thing.body.low + thing.body.high));
            Placed { thing, pose, centre, radius: 0.5 * thing.body.size().length() }
        };
        Self { street, time, placed: street.things.iter().map(place).collect() }
    }

    /// The things within a cone of rays from `origin` around `axis` (length 1), whose half angle is `half` radians.
    pub fn in_cone(&self, origin: DVec3, axis: DVec3, half: f64) -> Candidates {
        let inside = |placed: &&Placed<'_>| {
            let to = placed.centre - origin;
            let distance = to.length();
            distance <= placed.radius || axis.angle_between(to) <= half + (placed.radius / distance).asin()
        };
        self.chosen(inside)
    }

    /// The things that a fan of rays can meet: from `origin`, upright, in the direction `azimuth` seen from above.
    pub fn in_fan(&self, origin: DVec3, azimuth: f64) -> Candidates {
        let ahead = DVec2::new(azimuth.cos(), azimuth.sin());
        let inside = |placed: &&Placed<'_>| {
            let to = (placed.centre - origin).truncate();
            to.dot(ahead) >= -placed.radius && to.perp_dot(ahead).abs() <= placed.radius
        };
        self.chosen(inside)
    }

    fn chosen(&self, inside: impl Fn(&&Placed<'s>) -> bool) -> Candidates {
        let list = self.placed.iter().enumerate().filter(|(_, placed)| inside(placed)).map(|(i, _)| i as u32);
        Candidates(list.collect())
    }

    /// The nearest surface along a ray among candidates and the ground.
    pub fn meet(&self, ray: &Ray, candidates: &Candidates) -> Option<Hit<'s>> {
        let t = -ray.origin.z / ray.direction.z;
        let ground = (t > NEAR && t < FAR).then(|| {
            let position = ray.at(t);
            Hit { t, position, normal: DVec3::Z, on: None, local: position, local_normal: DVec3::Z }
        });
        let mut nearest = ground;
        for placed in candidates.0.iter().map(|index| &self.placed[*index as usize]) {
            let Some((local, solid::Hit { t, normal, part, .. })) = placed.meet(ray) else { continue };
            if nearest.as_ref().is_none_or(|hit| t < hit.t) {
                nearest = Some(Hit {
                    t,
                    position: ray.at(t),
                    normal: placed.pose.rotation * normal,
                    on: Some((placed.thing, &placed.thing.body.solid.parts[part])),
                    local: local.at(t),
                    local_normal: normal,
                });
            }
        }
        nearest
    }

    /// The share of light that a surface reflects; `footprint`: size of what is looked at, metres.
    pub fn albedo(&self, hit: &Hit<'_>, footprint: f64) -> DVec3 {
        match hit.on {
            Some((thing, part)) => part.paint.color(hit.local, hit.local_normal, thing.body.salt),
            None => {
                let p = hit.position.truncate();
                Ground::at(p, self.street.crossing).color(p, footprint, self.street.salt)
            }
        }
    }

    /// Light that leaves a surface, linear, 0 to 1.
    pub fn shade(&self, hit: &Hit<'_>, footprint: f64) -> DVec3 {
        let sun = self.street.sun;
        let facing = hit.normal.dot(sun);
        let ray = Ray { origin: hit.position + 1e-3 * hit.normal, direction: sun };
        let lit = if facing > 0.0 && !self.is_hidden(&ray) { facing } else { 0.0 };
        let light = SUN * lit + SKY * (0.5 + 0.5 * hit.normal.z);
        (self.albedo(hit, footprint) * light).clamp(DVec3::ZERO, DVec3::ONE)
    }

    fn is_hidden(&self, ray: &Ray) -> bool {
        self.placed.iter().any(|placed| placed.meet(ray).is_some())
    }

    /// The sky in a direction, linear.
    pub fn sky(&self, direction: DVec3) -> DVec3 {
        let height = direction.z.max(0.0);
        let clear = DVec3::new(0.62, 0.7, 0.8).lerp(DVec3::new(0.16, 0.32, 0.68), height.sqrt().min(1.0));
        // Clouds on a plane far above.
        let p = direction.truncate() / (height + 0.12);
        let cloud =
            noise(p.extend(0.3) * 1.3, self.street.salt ^ 5) + 0.5 * noise(p.extend(0.7) * 3.1, self.street.salt ^ 6);
        clear.lerp(DVec3::splat(0.85), ((cloud - 0.75) * 2.5).clamp(0.0, 0.9) * (4.0 * height).min(1.0))
    }

    /// How far a surface moves in the next `interval` seconds, metres.
    pub fn flow(&self, hit: &Hit<'_>, interval: f64) -> DVec3 {
        let Some((thing, _)) = hit.on.filter(|(thing, _)| thing.path.moves()) else { return DVec3::ZERO };
        let later = thing.path.at(self.time + interval).pose();
        (later.position + later.rotation * hit.local - hit.position).with_z(0.0)
    }

    /// PandaSet's class of a surface.
    pub fn semantic(&self, hit: &Hit<'_>) -> u8 {
        match hit.on {
            Some((thing, _)) => thing.body.semantic,
            None => match Ground::at(hit.position.truncate(), self.street.crossing) {
                Ground::Road => 7,
                Ground::Marking => 10,
                Ground::Sidewalk => 11,
                Ground::Soil => 6,
            },
        }
    }
}

impl Hit<'_> {
    /// The number of the vehicle or person; 0: none.
    pub fn instance(&self) -> u32 {
        self.on.map_or(0, |(thing, _)| thing.number)
    }

    /// The share of LiDAR beams that return nothing.
    pub fn swallows(&self) -> f64 {
        self.on.map_or(0.0, |(_, part)| Paint::swallows(&part.paint))
    }
}
