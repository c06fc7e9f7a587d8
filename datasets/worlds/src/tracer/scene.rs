//! A scene of static and moving bodies under one area lamp: the colour that a ray sees at a given time.
//!
//! Lambert's law, soft shadows, light from the sky; all surfaces are matt, so a position has one colour in every view.
//! The still part of a shot does not depend on time: a [`StaticPoint`] keeps the point that a ray meets there and the
//! positions on the lamp that light it, and at each instant only points that moving bodies cover or shade are worked
//! out again.

use glam::DVec3;

use super::motion::{Motion, Pose};
use super::shape::Ray;
use super::solid::{Hit, Solid};
use super::texture::Texture;

/// Positions on the lamp. The pattern is the same everywhere, so that a position has the same colour in every view.
const LAMP_RAYS: usize = 16;

/// The lamp's positions are dealt to this many rays in turn: the rays of a pixel together see the whole lamp.
pub(crate) const LAMP_SHARES: usize = 4;

/// A set of the lamp's positions, one bit each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Lit(u32);

impl Lit {
    /// The whole lamp.
    pub const ALL: Self = Self((1 << LAMP_RAYS) - 1);

    /// Every [`LAMP_SHARES`]-th position, from `index` on.
    pub fn share(index: usize) -> Self {
        let positions = (index % LAMP_SHARES..LAMP_RAYS).step_by(LAMP_SHARES);
        Self(positions.fold(0, |bits, position| bits | 1 << position))
    }

    fn keep(self, keeps: impl Fn(usize) -> bool) -> Self {
        let (mut left, mut kept) = (self.0, 0);
        while left != 0 {
            let position = left.trailing_zeros();
            left &= left - 1;
            kept |= u32::from(keeps(position as usize)) << position;
        }
        Self(kept)
    }
}

/// Shadow rays start this far off a surface, metres: farther than marching leaves it.
const LIFT: f64 = 1e-4;

/// A wall or floor, seen from the side its normal points to; `normal . position = offset`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plane {
    pub normal: DVec3,
    pub offset: f64,
    /// Nothing is there farther from the origin, metres.
    pub reach: f64,
    pub texture: Texture,
}

/// A body's pose, and the lamp as the body sees it: shadow rays are then tested in its coordinates without being
/// turned one by one.
#[derive(Debug, Clone)]
pub(crate) struct Placed {
    pub pose: Pose,
    lamp: [DVec3; LAMP_RAYS],
}

/// A moving body.
#[derive(Debug, Clone)]
pub(crate) struct MovingBody {
    pub name: String,
    pub solid: Solid,
    pub motion: Motion,
}

/// A round lamp.
#[derive(Debug, Clone)]
pub(crate) struct Lamp {
    pub centre: DVec3,
    pub radius: f64,
    positions: [DVec3; LAMP_RAYS],
}

/// Light of the sky, brighter towards the horizon, linear.
fn sky(direction: DVec3) -> DVec3 {
    DVec3::new(0.50, 0.60, 0.70).lerp(DVec3::new(0.22, 0.38, 0.66), direction.z.clamp(0.0, 1.0))
}

/// Planes, bodies and light. The camera stands inside the planes, which throw no shadows.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    pub planes: Vec<Plane>,
    pub still: Vec<(Placed, Solid)>,
    pub moving: Vec<MovingBody>,
    pub lamp: Lamp,
    /// Light that arrives at a surface facing the lamp.
    pub lamp_color: DVec3,
    /// Light from straight above and from straight below.
    pub ambient: [DVec3; 2],
    /// Rays that meet nothing show a sky; without one they show nothing.
    pub has_sky: bool,
}

/// The surface point that a ray meets without moving bodies.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StaticPoint {
    /// Infinite when the ray meets nothing but the sky.
    pub t: f64,
    pub position: DVec3,
    normal: DVec3,
    albedo: DVec3,
    /// The positions on the lamp that this ray asks for, and those of them that no static body hides.
    lamp: Lit,
    lit: Lit,
    /// Linear light.
    pub color: DVec3,
}

/// The surface point that a ray meets at an instant.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RaySample {
    /// Linear light.
    pub color: DVec3,
    /// The moving body that is met and where, if one is.
    pub body: Option<(usize, f64)>,
}

impl StaticPoint {
    pub fn is_met(&self) -> bool {
        self.t.is_finite()
    }
}

impl Lamp {
    /// A disc that faces the origin, its positions in a sunflower's pattern: even and without directions.
    pub fn new(centre: DVec3, radius: f64) -> Self {
        let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        let (across, up) = centre.normalize().any_orthonormal_pair();
        let positions = std::array::from_fn(|i| {
            let r = radius * ((i as f64 + 0.5) / LAMP_RAYS as f64).sqrt();
            let (sin, cos) = (i as f64 * golden_angle).sin_cos();
            centre + r * (cos * across + sin * up)
        });
        Self { centre, radius, positions }
    }

    /// A body at `pose` under this lamp.
    pub fn posed(&self, pose: Pose) -> Placed {
        let back = pose.rotation.conjugate();
        Placed { pose, lamp: self.positions.map(|position| back * (position - pose.position)) }
    }
}

impl Scene {
    /// All moving bodies at time `t`.
    pub fn placed(&self, t: f64) -> Vec<Placed> {
        self.moving.iter().map(|body| self.lamp.posed(body.motion.pose(t))).collect()
    }

    /// The point of planes and static bodies that a ray meets, lit as `lamp` says.
    pub fn still(&self, ray: &Ray, lamp: Lit) -> StaticPoint {
        let (mut t, mut normal, mut albedo) = (f64::INFINITY, DVec3::Z, DVec3::ZERO);
        let mut own = None;
        for plane in &self.planes {
            let facing = plane.normal.dot(ray.direction);
            let at = (plane.offset - plane.normal.dot(ray.origin)) / facing;
            if facing < 0.0 && at > 0.0 && at < t && ray.at(at).length_squared() < plane.reach * plane.reach {
                (t, normal) = (at, plane.normal);
                albedo = plane.texture.color(ray.at(at));
            }
        }
        for (index, (placed, solid)) in self.still.iter().enumerate() {
            if let Some(hit) = solid.intersect(ray, &placed.pose).filter(|hit| hit.t < t) {
                (t, normal) = (hit.t, hit.normal);
                albedo = solid.parts[hit.part].paint.color(hit.local);
                own = Some((index, hit.part));
            }
        }
        if t.is_infinite() {
            return StaticPoint {
                t,
                position: ray.origin,
                normal,
                albedo,
                lamp,
                lit: Lit(0),
                color: sky(ray.direction),
            };
        }
        let position = ray.at(t);
        let lit = self.lit_by_still(position + LIFT * normal, normal, lamp, own);
        StaticPoint { t, position, normal, albedo, lamp, lit, color: self.reflect(position, normal, albedo, lamp, lit) }
    }

    /// The point that a ray meets with the moving bodies at `bodies`; `still` is the point without them.
    pub fn sample(&self, ray: &Ray, still: &StaticPoint, bodies: &[Placed]) -> RaySample {
        let mut nearest: Option<(usize, Hit)> = None;
        for (index, (body, placed)) in self.moving.iter().zip(bodies).enumerate() {
            let limit = nearest.map_or(still.t, |(_, hit)| hit.t);
            if let Some(hit) = body.solid.intersect(ray, &placed.pose).filter(|hit| hit.t < limit) {
                nearest = Some((index, hit));
            }
        }
        let Some((index, hit)) = nearest else {
            return RaySample { color: self.shaded(still, bodies), body: None };
        };
        let position = ray.at(hit.t);
        let albedo = self.moving[index].solid.parts[hit.part].paint.color(hit.local);
        let origin = position + LIFT * hit.normal;
        let lit = self.lit_by_still(origin, hit.normal, still.lamp, None);
        let lit = self.lit_by_moving(origin, lit, bodies, Some((index, hit.part)));
        RaySample { color: self.reflect(position, hit.normal, albedo, still.lamp, lit), body: Some((index, hit.t)) }
    }

    /// Whether a moving body within `radius` of `centre` may cover or shade the point that a ray meets.
    pub fn may_touch(&self, ray: &Ray, still: &StaticPoint, centre: DVec3, radius: f64) -> bool {
        let ahead = (centre - ray.origin).dot(ray.direction).clamp(0.0, still.t.min(1e9));
        let may_cover = ray.at(ahead).distance_squared(centre) <= radius * radius;
        // Where nothing is met, nothing is shaded.
        may_cover || (still.is_met() && self.may_shade(still.position, centre, radius))
    }

    /// Whether a ball may stand between a position and any part of the lamp. A segment to a position on the lamp is, at
    /// share s of its length, at most s lamp radii away from the segment to the lamp's centre.
    fn may_shade(&self, position: DVec3, centre: DVec3, radius: f64) -> bool {
        let to_lamp = self.lamp.centre - position;
        let length = to_lamp.length();
        let direction = to_lamp / length;
        let ahead = (centre - position).dot(direction);
        let spread = self.lamp.radius * ((ahead + radius + self.lamp.radius) / length).clamp(0.0, 1.0);
        let reach = radius + spread;
        (position + ahead.clamp(0.0, length) * direction).distance_squared(centre) <= reach * reach
    }

    /// The colour of a still position under the moving bodies' shadows.
    fn shaded(&self, still: &StaticPoint, bodies: &[Placed]) -> DVec3 {
        let StaticPoint { position, normal, albedo, lamp, .. } = *still;
        let lit = self.lit_by_moving(position + LIFT * normal, still.lit, bodies, None);
        if lit == still.lit { still.color } else { self.reflect(position, normal, albedo, lamp, lit) }
    }

    /// The positions in `lit` that moving bodies do not hide from above a surface; `own` is the moving body and part
    /// that the surface is on.
    fn lit_by_moving(&self, origin: DVec3, lit: Lit, bodies: &[Placed], own: Option<(usize, usize)>) -> Lit {
        self.unhidden(origin, lit, bodies.iter().zip(self.moving.iter().map(|body| &body.solid)), own)
    }

    /// The positions in `lamp` that a surface faces and no static body hides; `own` as above, among static bodies.
    fn lit_by_still(&self, origin: DVec3, normal: DVec3, lamp: Lit, own: Option<(usize, usize)>) -> Lit {
        let lit = lamp.keep(|i| normal.dot(self.lamp.positions[i] - origin) > 0.0);
        self.unhidden(origin, lit, self.still.iter().map(|(placed, solid)| (placed, solid)), own)
    }

    /// The positions in `lit` that no body hides from `origin`; `own` is the body and part that it is on.
    fn unhidden<'a>(
        &self,
        origin: DVec3,
        mut lit: Lit,
        bodies: impl Iterator<Item = (&'a Placed, &'a Solid)>,
        own: Option<(usize, usize)>,
    ) -> Lit {
        for (index, (placed, solid)) in bodies.enumerate() {
            let except = own.filter(|(own, _)| *own == index).map(|(_, part)| part);
            let is_alone = except.is_some() && solid.parts.len() == 1;
            if lit.0 != 0 && !is_alone && self.may_shade(origin, placed.pose.position, solid.radius) {
                let local = placed.pose.rotation.conjugate() * (origin - placed.pose.position);
                lit = lit.keep(|i| !solid.is_between(local, placed.lamp[i] - local, except));
            }
        }
        lit
    }

    /// Light that leaves a position (linear, not above 1) when `lit` of the lamp's positions `lamp` light it.
    fn reflect(&self, position: DVec3, normal: DVec3, albedo: DVec3, lamp: Lit, lit: Lit) -> DVec3 {
        let (mut direct, mut left) = (0.0, lit.0);
        while left != 0 {
            let to_lamp = self.lamp.positions[left.trailing_zeros() as usize] - position;
            direct += normal.dot(to_lamp).max(0.0) / to_lamp.length();
            left &= left - 1;
        }
        let direct = direct / f64::from(lamp.0.count_ones());
        let ambient = self.ambient[1].lerp(self.ambient[0], 0.5 + 0.5 * normal.z);
        (albedo * (self.lamp_color * direct + ambient)).clamp(DVec3::ZERO, DVec3::ONE)
    }
}
