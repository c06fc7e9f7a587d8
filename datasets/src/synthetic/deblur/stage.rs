//! A room with still and moving bodies under one area lamp: what a ray sees at a given time.
//!
//! Lambert's law, soft shadows, light from the sky; all surfaces are matt, so a place has one colour in every view. The
//! still part of a shot does not depend on time: a [`StillPoint`] keeps what a ray meets there and which places on the
//! lamp light it, and at each instant only what movers cover or shade is worked out again.

use glam::DVec3;

use super::super::shapes::Ray;
use super::body::{Body, Hit};
use super::motion::{Motion, Pose};
use super::texture::Texture;

/// Places on the lamp. The pattern is the same everywhere, so that a place has the same colour in every view.
const LAMP_RAYS: usize = 16;

/// The lamp's places are dealt to this many rays in turn: the rays of a pixel together see the whole lamp.
pub(super) const LAMP_SHARES: usize = 4;

/// A set of the lamp's places, one bit each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Lit(u32);

impl Lit {
    /// The whole lamp.
    pub const ALL: Self = Self((1 << LAMP_RAYS) - 1);

    /// Every [`LAMP_SHARES`]-th place, from `index` on.
    pub fn share(index: usize) -> Self {
        let places = (index % LAMP_SHARES..LAMP_RAYS).step_by(LAMP_SHARES);
        Self(places.fold(0, |bits, place| bits | 1 << place))
    }

    fn keep(self, keeps: impl Fn(usize) -> bool) -> Self {
        let (mut left, mut kept) = (self.0, 0);
        while left != 0 {
            let place = left.trailing_zeros();
            left &= left - 1;
            kept |= u32::from(keeps(place as usize)) << place;
        }
        Self(kept)
    }
}

/// Shadow rays start this far off a surface, metres: farther than marching leaves it.
const LIFT: f64 = 1e-4;

/// A wall or floor, seen from the side its normal points to; `normal . place = offset`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Plane {
    pub normal: DVec3,
    pub offset: f64,
    /// Nothing is there farther from the origin, metres.
    pub reach: f64,
    pub texture: Texture,
}

/// A body's pose, and the lamp as the body sees it: shadow rays are then tested in the body's coordinates without being
/// turned one by one.
#[derive(Debug, Clone)]
pub(super) struct Placed {
    pub pose: Pose,
    lamp: [DVec3; LAMP_RAYS],
}

/// A moving body.
#[derive(Debug, Clone)]
pub(super) struct Mover {
    pub name: &'static str,
    pub body: Body,
    pub motion: Motion,
}

/// A round lamp.
#[derive(Debug, Clone)]
pub(super) struct Lamp {
    pub centre: DVec3,
    pub radius: f64,
    places: [DVec3; LAMP_RAYS],
}

/// Light of the sky, brighter towards the horizon, linear.
fn sky(direction: DVec3) -> DVec3 {
    DVec3::new(0.50, 0.60, 0.70).lerp(DVec3::new(0.22, 0.38, 0.66), direction.z.clamp(0.0, 1.0))
}

/// Everything there is. The camera stands inside the planes, which throw no shadows.
#[derive(Debug, Clone)]
pub(super) struct Stage {
    pub planes: Vec<Plane>,
    pub still: Vec<(Placed, Body)>,
    pub movers: Vec<Mover>,
    pub lamp: Lamp,
    /// Light that arrives at a surface facing the lamp.
    pub lamp_color: DVec3,
    /// Light from straight above and from straight below.
    pub sky: [DVec3; 2],
}

/// What a ray meets when no mover is there.
#[derive(Debug, Clone, Copy)]
pub(super) struct StillPoint {
    /// Infinite when the ray meets nothing but the sky.
    pub t: f64,
    pub place: DVec3,
    normal: DVec3,
    albedo: DVec3,
    /// The places on the lamp that this ray asks for, and those of them that no still body hides.
    lamp: Lit,
    lit: Lit,
    /// Linear light.
    pub color: DVec3,
}

/// What a ray meets at an instant.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sight {
    /// Linear light.
    pub color: DVec3,
    /// The mover that is met and where, if one is.
    pub mover: Option<(usize, f64)>,
}

impl Lamp {
    /// A disc that faces the origin, its places in a sunflower's pattern: even and without directions.
    pub fn new(centre: DVec3, radius: f64) -> Self {
        let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
        let (across, up) = centre.normalize().any_orthonormal_pair();
        let places = std::array::from_fn(|i| {
            let r = radius * ((i as f64 + 0.5) / LAMP_RAYS as f64).sqrt();
            let (sin, cos) = (i as f64 * golden_angle).sin_cos();
            centre + r * (cos * across + sin * up)
        });
        Self { centre, radius, places }
    }

    /// A body at `pose` under this lamp.
    pub fn place(&self, pose: Pose) -> Placed {
        let back = pose.rotation.conjugate();
        Placed { pose, lamp: self.places.map(|place| back * (place - pose.position)) }
    }
}

impl Stage {
    /// All movers at time `t`.
    pub fn placed(&self, t: f64) -> Vec<Placed> {
        self.movers.iter().map(|mover| self.lamp.place(mover.motion.pose(t))).collect()
    }

    /// What a ray meets of planes and still bodies, as the places in `lamp` light it.
    pub fn still(&self, ray: &Ray, lamp: Lit) -> StillPoint {
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
        for (index, (placed, body)) in self.still.iter().enumerate() {
            if let Some(hit) = body.intersect(ray, &placed.pose).filter(|hit| hit.t < t) {
                (t, normal) = (hit.t, hit.normal);
                albedo = body.parts[hit.part].texture.color(hit.local);
                own = Some((index, hit.part));
            }
        }
        if t.is_infinite() {
            return StillPoint { t, place: ray.origin, normal, albedo, lamp, lit: Lit(0), color: sky(ray.direction) };
        }
        let place = ray.at(t);
        let lit = self.lit_by_still(place, normal, lamp, own);
        StillPoint { t, place, normal, albedo, lamp, lit, color: self.reflect(place, normal, albedo, lamp, lit) }
    }

    /// What a ray meets when the movers are at `movers`; `still` is what it meets without them.
    pub fn sight(&self, ray: &Ray, still: &StillPoint, movers: &[Placed]) -> Sight {
        let mut nearest: Option<(usize, Hit)> = None;
        for (index, (mover, placed)) in self.movers.iter().zip(movers).enumerate() {
            let limit = nearest.map_or(still.t, |(_, hit)| hit.t);
            if let Some(hit) = mover.body.intersect(ray, &placed.pose).filter(|hit| hit.t < limit) {
                nearest = Some((index, hit));
            }
        }
        let Some((index, hit)) = nearest else {
            return Sight { color: self.shaded(still, movers), mover: None };
        };
        let place = ray.at(hit.t);
        let albedo = self.movers[index].body.parts[hit.part].texture.color(hit.local);
        let lit = self.lit_by_still(place, hit.normal, still.lamp, None);
        let lit = self.lit_by_movers(place, hit.normal, lit, movers, Some((index, hit.part)));
        Sight { color: self.reflect(place, hit.normal, albedo, still.lamp, lit), mover: Some((index, hit.t)) }
    }

    /// Whether a mover within `radius` of `centre` may cover or shade what a ray meets.
    pub fn may_touch(&self, ray: &Ray, still: &StillPoint, centre: DVec3, radius: f64) -> bool {
        let ahead = (centre - ray.origin).dot(ray.direction).clamp(0.0, still.t.min(1e9));
        ray.at(ahead).distance_squared(centre) <= radius * radius || self.may_shade(still.place, centre, radius)
    }

    /// Whether a ball may stand between a place and any part of the lamp. A segment to a place on the lamp is, at share
    /// s of its length, at most s lamp radii away from the segment to the lamp's centre.
    fn may_shade(&self, place: DVec3, centre: DVec3, radius: f64) -> bool {
        let to_lamp = self.lamp.centre - place;
        let length = to_lamp.length();
        let direction = to_lamp / length;
        let ahead = (centre - place).dot(direction);
        let spread = self.lamp.radius * ((ahead + radius + self.lamp.radius) / length).clamp(0.0, 1.0);
        let reach = radius + spread;
        (place + ahead.clamp(0.0, length) * direction).distance_squared(centre) <= reach * reach
    }

    /// The colour of a still place under the movers' shadows.
    fn shaded(&self, still: &StillPoint, movers: &[Placed]) -> DVec3 {
        let StillPoint { place, normal, albedo, lamp, .. } = *still;
        let lit = self.lit_by_movers(place, normal, still.lit, movers, None);
        if lit == still.lit { still.color } else { self.reflect(place, normal, albedo, lamp, lit) }
    }

    /// The places in `lit` that movers do not hide; `own` is the mover and part that the place is on.
    fn lit_by_movers(
        &self,
        place: DVec3,
        normal: DVec3,
        mut lit: Lit,
        movers: &[Placed],
        own: Option<(usize, usize)>,
    ) -> Lit {
        let origin = place + LIFT * normal;
        for (index, (mover, placed)) in self.movers.iter().zip(movers).enumerate() {
            let except = own.filter(|(own, _)| *own == index).map(|(_, part)| part);
            lit = self.unhidden(origin, lit, &mover.body, placed, except);
        }
        lit
    }

    /// The places in `lamp` that a surface faces and no still body hides; `own` as above, among still bodies.
    fn lit_by_still(&self, place: DVec3, normal: DVec3, lamp: Lit, own: Option<(usize, usize)>) -> Lit {
        let origin = place + LIFT * normal;
        let mut lit = lamp.keep(|i| normal.dot(self.lamp.places[i] - origin) > 0.0);
        for (index, (placed, body)) in self.still.iter().enumerate() {
            let except = own.filter(|(own, _)| *own == index).map(|(_, part)| part);
            lit = self.unhidden(origin, lit, body, placed, except);
        }
        lit
    }

    /// The places in `lit` that a body does not hide from `origin`; `except` is the part of the body it is on.
    fn unhidden(&self, origin: DVec3, lit: Lit, body: &Body, placed: &Placed, except: Option<usize>) -> Lit {
        let is_alone = except.is_some() && body.parts.len() == 1;
        if lit.0 == 0 || is_alone || !self.may_shade(origin, placed.pose.position, body.radius) {
            return lit;
        }
        let origin = placed.pose.rotation.conjugate() * (origin - placed.pose.position);
        lit.keep(|i| !body.is_between(origin, placed.lamp[i] - origin, except))
    }

    /// Light that leaves a place (linear, not above 1) when `lit` of the lamp's places `lamp` light it.
    fn reflect(&self, place: DVec3, normal: DVec3, albedo: DVec3, lamp: Lit, lit: Lit) -> DVec3 {
        let (mut direct, mut left) = (0.0, lit.0);
        while left != 0 {
            let to_lamp = self.lamp.places[left.trailing_zeros() as usize] - place;
            direct += normal.dot(to_lamp).max(0.0) / to_lamp.length();
            left &= left - 1;
        }
        let direct = direct / f64::from(lamp.0.count_ones());
        let sky = self.sky[1].lerp(self.sky[0], 0.5 + 0.5 * normal.z);
        (albedo * (self.lamp_color * direct + sky)).clamp(DVec3::ZERO, DVec3::ONE)
    }
}
