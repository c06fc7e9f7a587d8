//! A world of painted shapes under one area light: Lambert's law, soft shadows, light from the sky.

use glam::DVec3;

use super::shapes::{Paint, Pattern, Shape};
use crate::tracer::shape::{Ray, SKIN};

/// Rays towards the light from every shaded place. The pattern is the same everywhere, so that a place has the same
/// colour in every view; more would smooth the steps in the half shadow below what 8 bits show.
const LIGHT_RAYS: usize = 24;

/// One painted shape.
pub(super) struct Object {
    pub shape: Shape,
    pub paint: Paint,
}

impl Object {
    fn centre(&self) -> DVec3 {
        match self.shape {
            Shape::Sphere { centre, .. } | Shape::Cuboid { centre, .. } | Shape::Disc { centre, .. } => centre,
        }
    }
}

/// Objects and a round light that faces the origin.
pub(super) struct World {
    pub objects: Vec<Object>,
    /// Places on the light, metres.
    light: Vec<DVec3>,
    /// Light that arrives at a surface facing the lamp.
    lamp: DVec3,
    /// Light from straight above and from straight below.
    sky: [DVec3; 2],
}

impl World {
    /// The demo's world: a round checkered floor of 1.7 m radius, spheres, and a box with a sphere on it; z is up.
    pub fn demo() -> Self {
        let sphere = |x: f64, y: f64, z: f64, radius: f64| Shape::Sphere { centre: DVec3::new(x, y, z), radius };
        let object = |shape: Shape, pattern: Pattern, a: [f64; 3], b: [f64; 3]| Object {
            shape,
            paint: Paint { pattern, colors: [DVec3::from_array(a), DVec3::from_array(b)] },
        };
        let floor = Shape::Disc { centre: DVec3::ZERO, radius: 1.7 };
        let wooden_box = Shape::Cuboid { centre: DVec3::new(-0.45, 0.40, 0.29), half: DVec3::splat(0.29) };
        let objects = vec![
            object(floor, Pattern::Checker(0.4), [0.72, 0.70, 0.66], [0.16, 0.19, 0.25]),
            object(wooden_box, Pattern::Blocks(0.2), [0.78, 0.52, 0.16], [0.50, 0.26, 0.08]),
            object(RED_SPHERE, Pattern::Bands(6.0), [0.75, 0.03, 0.03], [0.38, 0.01, 0.015]),
            object(sphere(0.62, 0.30, 0.42, 0.42), Pattern::Swirls(3.0), [0.05, 0.30, 0.62], [0.75, 0.85, 0.90]),
            object(sphere(0.10, -0.72, 0.28, 0.28), Pattern::Bands(9.0), [0.10, 0.45, 0.12], [0.85, 0.80, 0.25]),
            object(sphere(-0.85, -0.48, 0.20, 0.20), Pattern::Swirls(5.0), [0.52, 0.10, 0.48], [0.90, 0.62, 0.75]),
        ];
        Self {
            objects,
            light: round_light(DVec3::new(2.2, -1.6, 3.6), 0.55),
            lamp: DVec3::new(0.86, 0.80, 0.70),
            sky: [DVec3::new(0.22, 0.26, 0.34), DVec3::new(0.10, 0.09, 0.08)],
        }
    }

    /// The colour (encoded, 0 to 1) that a ray meets; `None` where it leaves the world.
    pub fn trace(&self, ray: &Ray) -> Option<DVec3> {
        let nearest = self
            .objects
            .iter()
            .filter_map(|object| object.shape.intersect(ray).map(|crossing| (object, crossing)))
            .min_by(|a, b| a.1.t.total_cmp(&b.1.t));
        nearest.map(|(object, crossing)| self.shade(object, ray.at(crossing.t), crossing.normal))
    }

    /// The colour (encoded, 0 to 1) of a place on an object. It is the same from every side.
    pub fn shade(&self, object: &Object, place: DVec3, normal: DVec3) -> DVec3 {
        let start = place + 10.0 * SKIN * normal;
        let mut direct = 0.0;
        for lamp in &self.light {
            let to_lamp = *lamp - start;
            let distance = to_lamp.length();
            let ray = Ray { origin: start, direction: to_lamp / distance };
            let facing = normal.dot(ray.direction);
            let is_free = || {
                let blocks = |other: &Object| other.shape.intersect(&ray).is_some_and(|hit| hit.t < distance);
                !self.objects.iter().any(blocks)
            };
            if facing > 0.0 && is_free() {
                direct += facing;
            }
        }
        direct /= self.light.len() as f64;
        let sky = self.sky[1].lerp(self.sky[0], 0.5 + 0.5 * normal.z);
        let linear = object.paint.color(place - object.centre()) * (self.lamp * direct + sky);
        linear.clamp(DVec3::ZERO, DVec3::ONE).powf(1.0 / 2.2)
    }
}

/// The sphere on the box: plain red in hue, so that tests can find it by colour.
pub(super) const RED_SPHERE: Shape = Shape::Sphere { centre: DVec3::new(-0.45, 0.40, 0.84), radius: 0.26 };

/// Places on a disc that faces the origin, in a sunflower's pattern: even and without directions.
fn round_light(centre: DVec3, radius: f64) -> Vec<DVec3> {
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let (across, up) = centre.normalize().any_orthonormal_pair();
    (0..LIGHT_RAYS)
        .map(|i| {
            let r = radius * ((i as f64 + 0.5) / LIGHT_RAYS as f64).sqrt();
            let (sin, cos) = (i as f64 * golden_angle).sin_cos();
            centre + r * (cos * across + sin * up)
        })
        .collect()
}
