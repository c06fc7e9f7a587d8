//! Forms in the axes of a body, and where rays meet them.

use glam::DVec3;

use crate::tracer::shape::Ray;

/// Nearer crossings do not count, metres: a surface does not shade itself.
pub(super) const SKIN: f64 = 1e-4;

/// A form in the axes of its body, metres.
#[derive(Debug, Clone, Copy)]
pub(super) enum Shape {
    Cuboid {
        centre: DVec3,
        half: DVec3,
    },
    Ball {
        centre: DVec3,
        radius: f64,
    },
    /// Upright, closed above.
    Column {
        centre: DVec3,
        radius: f64,
        half_height: f64,
    },
}

impl Shape {
    /// The nearest crossing in front of the origin from outside, and the outward normal there.
    pub fn meet(&self, ray: &Ray) -> Option<(f64, DVec3)> {
        match *self {
            Self::Cuboid { centre, half } => cuboid(ray, centre, half),
            Self::Ball { centre, radius } => {
                let to_origin = ray.origin - centre;
                let b = to_origin.dot(ray.direction);
                let root = b * b - to_origin.length_squared() + radius * radius;
                let t = -b - root.max(0.0).sqrt();
                (root > 0.0 && t > SKIN).then(|| (t, (ray.at(t) - centre) / radius))
            }
            Self::Column { centre, radius, half_height } => column(ray, centre, radius, half_height),
        }
    }

    /// Corners of the box around the form.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let (centre, half) = match *self {
            Self::Cuboid { centre, half } => (centre, half),
            Self::Ball { centre, radius } => (centre, DVec3::splat(radius)),
            Self::Column { centre, radius, half_height } => (centre, DVec3::new(radius, radius, half_height)),
        };
        (centre - half, centre + half)
    }
}

fn cuboid(ray: &Ray, centre: DVec3, half: DVec3) -> Option<(f64, DVec3)> {
    let inverse = ray.direction.recip();
    let (a, b) = ((centre - half - ray.origin) * inverse, (centre + half - ray.origin) * inverse);
    let near = a.min(b);
    let (enter, leave) = (near.max_element(), a.max(b).min_element());
    if !(enter <= leave && enter > SKIN) {
        return None;
    }
    let axis = if near.x >= near.y && near.x >= near.z {
        0
    } else if near.y >= near.z {
        1
    } else {
        2
    };
    let mut normal = DVec3::ZERO;
    normal[axis] = -ray.direction[axis].signum();
    Some((enter, normal))
}

fn column(ray: &Ray, centre: DVec3, radius: f64, half_height: f64) -> Option<(f64, DVec3)> {
    let o = ray.origin - centre;
    let (d, flat) = (ray.direction, ray.direction.truncate().length_squared());
    let b = o.truncate().dot(d.truncate());
    let root = b * b - flat * (o.truncate().length_squared() - radius * radius);
    if root > 0.0 && flat > 0.0 {
        let t = (-b - root.sqrt()) / flat;
        let p = o + t * d;
        if t > SKIN && p.z.abs() <= half_height {
            return Some((t, (p.truncate() / radius).extend(0.0)));
        }
    }
    let t = (half_height - o.z) / d.z;
    let is_top = t.is_finite() && t > SKIN && d.z < 0.0 && (o + t * d).truncate().length_squared() <= radius * radius;
    is_top.then_some((t, DVec3::Z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_meet_forms_from_outside() {
        let ray = Ray { origin: DVec3::new(-5.0, 0.2, 0.1), direction: DVec3::X };
        let forms = [
            Shape::Cuboid { centre: DVec3::ZERO, half: DVec3::ONE },
            Shape::Ball { centre: DVec3::ZERO, radius: 1.0 },
            Shape::Column { centre: DVec3::ZERO, radius: 1.0, half_height: 1.0 },
        ];
        let expected = [4.0, 5.0 - (1.0_f64 - 0.05).sqrt(), 5.0 - (1.0_f64 - 0.04).sqrt()];
        for (form, expected) in forms.iter().zip(expected) {
            let (t, normal) = form.meet(&ray).expect("a crossing");
            assert!((t - expected).abs() < 1e-12 && normal.x < -0.9, "{form:?}: {t}, {normal}");
            assert!(form.meet(&Ray { direction: -DVec3::X, ..ray }).is_none(), "behind: {form:?}");
            assert!(form.meet(&Ray { origin: DVec3::new(0.1, 0.1, 0.1), ..ray }).is_none(), "from inside: {form:?}");
        }
        let down = Ray { origin: DVec3::new(0.3, 0.0, 4.0), direction: -DVec3::Z };
        assert_eq!(forms[2].meet(&down), Some((3.0, DVec3::Z)));
    }
}
