//! Where a lens shows a direction, before it is bent by distortion: [`Projection`].

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// The map from directions to the ideal normalised coordinates of a photo. [`Distortion`](crate::Distortion) bends
/// these, and focal lengths and principal point make them pixels.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) enum Projection {
    /// The distance from the principal point is the tangent of the angle to the optical axis.
    #[default]
    Pinhole,
    /// The distance is that angle, radians: the fisheye models of OpenCV and COLMAP.
    Fisheye,
    /// The distance is `atan(2 tan(angle) tan(w / 2)) / w`, w in radians: COLMAP's FOV (Devernay and Faugeras, 2001).
    Fov(f64),
    /// Longitude to the right and latitude downwards, radians.
    Equirectangular,
}

impl Projection {
    /// The ideal normalised coordinates of a direction (OpenCV camera axes, of any length); `None` of a direction that
    /// no photo of this kind shows.
    pub fn of_ray(self, ray: DVec3) -> Option<(f64, f64)> {
        let DVec3 { x, y, z } = ray;
        let across = x.hypot(y);
        let radius = match self {
            Self::Pinhole => return (z > 0.0).then_some((x / z, y / z)),
            Self::Equirectangular => return Some((x.atan2(z), y.atan2(x.hypot(z)))),
            Self::Fisheye => across.atan2(z),
            Self::Fov(w) => (2.0 * across * (0.5 * w).tan()).atan2(z) / w,
        };
        // On the axis itself any direction of the photo is as good.
        Some(if across > 0.0 { (radius * x / across, radius * y / across) } else { (radius, 0.0) })
    }

    /// No direction has coordinates farther from 0.
    pub fn reach(self) -> f64 {
        match self {
            Self::Pinhole => f64::INFINITY,
            Self::Fisheye => PI,
            Self::Fov(w) => PI / w,
            Self::Equirectangular => TAU,
        }
    }

    /// Normalised coordinates per radian in the middle of the photo.
    pub fn central_scale(self) -> f64 {
        match self {
            Self::Fov(w) => 2.0 * (0.5 * w).tan() / w,
            _ => 1.0,
        }
    }

    /// The kind of photo, for a sentence.
    pub fn kind(self) -> &'static str {
        match self {
            Self::Pinhole => "pinhole",
            Self::Fisheye | Self::Fov(_) => "fisheye",
            Self::Equirectangular => "equirectangular",
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    fn close(found: Option<(f64, f64)>, expected: (f64, f64)) -> bool {
        found.is_some_and(|(x, y)| (x - expected.0).abs() < 1e-12 && (y - expected.1).abs() < 1e-12)
    }

    #[test]
    fn directions_by_hand() {
        let (right, down, behind) = (DVec3::X, DVec3::Y, DVec3::NEG_Z);
        assert!(close(Projection::Pinhole.of_ray(DVec3::new(1.0, -3.0, 2.0)), (0.5, -1.5)));
        assert_eq!(Projection::Pinhole.of_ray(right), None);
        assert!(close(Projection::Fisheye.of_ray(2.0 * right), (FRAC_PI_2, 0.0)));
        assert!(close(Projection::Fisheye.of_ray(down), (0.0, FRAC_PI_2)));
        assert!(close(Projection::Fisheye.of_ray(behind), (PI, 0.0)));
        assert!(close(Projection::Fisheye.of_ray(DVec3::Z), (0.0, 0.0)));
        // tan(45 degrees) = 1 and w = 90 degrees: atan(2) / w.
        let expected = 2.0_f64.atan() / FRAC_PI_2;
        assert!(close(Projection::Fov(FRAC_PI_2).of_ray(DVec3::new(1.0, 0.0, 1.0)), (expected, 0.0)));
        assert!(close(Projection::Equirectangular.of_ray(right), (FRAC_PI_2, 0.0)));
        assert!(close(Projection::Equirectangular.of_ray(down), (0.0, FRAC_PI_2)));
        assert!(close(
            Projection::Equirectangular.of_ray(DVec3::new(1.0, -(2.0_f64.sqrt()), -1.0)),
            (0.75 * PI, -PI / 4.0)
        ));
    }
}
