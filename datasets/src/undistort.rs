//! Removing lens distortion: for each pixel of the ideal pinhole image, where the photo shows it.
//!
//! The ideal image of a pinhole's photo has the photo's size and fx, fy, cx, cy; those of wide photos are their
//! [`faces`](crate::faces). The lens model runs forward (ideal to observed), so nothing is inverted. Colours are
//! interpolated between the four pixels around the observed position; ideal pixels whose observed position lies outside
//! the photo, or where the lens model folds back on itself, have no colour and are masked out.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DMat3, DVec3};
use gs_base::Intrinsics;

use crate::distortion::Distortion;
use crate::face::Face;
use crate::lens::Lens;
use crate::pixels::Photo;
use crate::projection::Projection;

/// Most by which [`Undistortion::filling`] enlarges the focal lengths. A lens that needs more would lose three quarters
/// of the photo.
const ZOOM_MAX: f64 = 2.0;

/// Halvings of the interval of enlargements: the last one moves no pixel of an image with 65 535 columns by a hundredth
/// of its width.
const ZOOM_STEPS: usize = 24;

/// Halvings of the interval of angles: a hundredth of a pixel of the largest photos.
const ANGLE_STEPS: usize = 32;

/// From ideal pixels to positions in the photo.
#[derive(Debug, Clone, PartialEq)]
pub struct Undistortion {
    projection: Projection,
    distortion: Distortion,
    /// The photo's.
    intrinsics: Intrinsics,
    /// The photo's.
    width: f64,
    height: f64,
    valid_radius2: f64,
    /// From the camera axes of the ideal image to those of the photo.
    rotation: DMat3,
    /// 1/fx and 1/fy of the ideal image.
    inverse: (f64, f64),
    /// Principal point of the ideal image, pixels.
    centre: (f64, f64),
    /// Width and height of the ideal image, pixels.
    ideal: (usize, usize),
}

impl Undistortion {
    /// For a photo of `size` pixels with these intrinsics; `None` when there is nothing to undo, or the
    /// ideal image has no end.
    pub(crate) fn new(distortion: Distortion, intrinsics: Intrinsics, size: (usize, usize)) -> Option<Self> {
        if distortion.is_none() { None } else { Self::of(distortion, intrinsics, size) }
    }

    /// `None` when the ideal image has no end.
    fn of(distortion: Distortion, intrinsics: Intrinsics, size: (usize, usize)) -> Option<Self> {
        // The limit of the search for a fold; the ideal image shows no more than this.
        let far = |side: f64, c: f64, f: f64| (c / f).abs().max(((side - c) / f).abs());
        let x = far(size.0 as f64, intrinsics.cx, intrinsics.fx);
        let y = far(size.1 as f64, intrinsics.cy, intrinsics.fy);
        let this = Self::within(x * x + y * y, Projection::Pinhole, distortion, intrinsics, size);
        (x.is_finite() && y.is_finite()).then_some(this)
    }

    /// For a photo of `size` pixels by a lens of any kind; the ideal image is yet that of a pinhole with the same
    /// intrinsics. The corners of a fisheye photo are left out from a right angle to the optical axis on, or from the
    /// angle on that its shorter sides reach: lenses that wide have a round image, which is dark in the corners.
    pub(crate) fn wide(lens: &Lens, intrinsics: Intrinsics, size: (usize, usize)) -> Self {
        let projection = lens.projection;
        let photo = Self::within(projection.reach().powi(2), projection, lens.distortion, intrinsics, size);
        if projection == Projection::Equirectangular {
            return photo;
        }
        let along = |axis: DVec3| photo.angle_towards(axis).max(photo.angle_towards(-axis));
        let circle = along(DVec3::X).min(along(DVec3::Y)).max(FRAC_PI_2);
        let rim = projection.of_ray(DVec3::new(circle.sin(), 0.0, circle.cos()));
        let valid_radius2 = photo.valid_radius2.min(rim.map_or(f64::INFINITY, |(x, y)| x * x + y * y));
        Self { valid_radius2, ..photo }
    }

    /// The largest angle to the optical axis, radians, that a wide photo shows towards a side of length 1, across the
    /// axis; 0 where it does not show the axis.
    pub(crate) fn angle_towards(&self, side: DVec3) -> f64 {
        let (mut low, mut high) = (0.0, PI);
        for _ in 0..ANGLE_STEPS {
            let middle: f64 = 0.5 * (low + high);
            let is_shown = self.of_ray(middle.cos() * DVec3::Z + middle.sin() * side).is_some();
            if is_shown { low = middle } else { high = middle }
        }
        low
    }

    /// `reach2` is the squared radius, in normalised coordinates, beyond which no ideal point is asked for.
    fn within(
        reach2: f64,
        projection: Projection,
        distortion: Distortion,
        intrinsics: Intrinsics,
        size: (usize, usize),
    ) -> Self {
        Self {
            projection,
            distortion,
            intrinsics,
            width: size.0 as f64,
            height: size.1 as f64,
            valid_radius2: distortion.valid_radius2(reach2),
            rotation: DMat3::IDENTITY,
            inverse: (1.0 / intrinsics.fx, 1.0 / intrinsics.fy),
            centre: (intrinsics.cx, intrinsics.cy),
            ideal: size,
        }
    }

    /// With a face as the ideal image.
    pub(crate) fn onto(self, face: &Face) -> Self {
        let Intrinsics { fx, fy, cx, cy } = face.intrinsics;
        Self { rotation: face.rotation, inverse: (1.0 / fx, 1.0 / fy), centre: (cx, cy), ideal: face.size, ..self }
    }

    /// For readers without masks: the focal lengths of the ideal image are larger than `intrinsics`, those of the
    /// photo, by the smallest factor with which every pixel of the ideal image is in the photo; the principal point
    /// stays. Also the ideal intrinsics. `None` when a coefficient is not finite, or when the factor would be above 2.
    pub fn filling(distortion: Distortion, intrinsics: Intrinsics, size: (usize, usize)) -> Option<(Self, Intrinsics)> {
        let plain = Self::of(distortion, intrinsics, size).filter(|_| distortion.is_finite())?;
        let zoomed = |zoom: f64| Self { inverse: (plain.inverse.0 / zoom, plain.inverse.1 / zoom), ..plain.clone() };
        let (mut low, mut high) = (1.0, ZOOM_MAX);
        if zoomed(low).is_filled() {
            high = low;
        } else if !zoomed(high).is_filled() {
            return None;
        }
        for _ in 0..ZOOM_STEPS {
            let middle = 0.5 * (low + high);
            if zoomed(middle).is_filled() { high = middle } else { low = middle }
        }
        let Intrinsics { fx, fy, cx, cy } = intrinsics;
        Some((zoomed(high), Intrinsics { fx: fx * high, fy: fy * high, cx, cy }))
    }

    /// Whether every pixel of the ideal image is in the photo. The pixels of the border are looked at: within the fold
    /// the model is continuous and one to one, so that the inside of the border's curve stays inside.
    fn is_filled(&self) -> bool {
        let shows = |u: f64, v: f64| self.observed(u, v).is_some();
        let pixels = |side: f64| (0..side as usize).map(|i| i as f64 + 0.5);
        pixels(self.width).all(|u| shows(u, 0.5) && shows(u, self.height - 0.5))
            && pixels(self.height).all(|v| shows(0.5, v) && shows(self.width - 0.5, v))
    }

    /// Width and height of the ideal image, pixels.
    pub(crate) fn ideal_size(&self) -> (usize, usize) {
        self.ideal
    }

    /// Width and height of the photo, pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.width as usize, self.height as usize)
    }

    /// The photo's position of the ideal image's point (u, v), in pixels from the corner; `None` outside the photo.
    pub fn observed(&self, u: f64, v: f64) -> Option<(f64, f64)> {
        let (x, y) = ((u - self.centre.0) * self.inverse.0, (v - self.centre.1) * self.inverse.1);
        match self.projection {
            Projection::Pinhole => self.distorted(x, y),
            _ => self.of_ray(self.rotation * DVec3::new(x, y, 1.0)),
        }
    }

    /// The photo's position of a direction in its camera axes, in pixels from the corner; `None` outside the photo.
    #[inline]
    pub(crate) fn of_ray(&self, ray: DVec3) -> Option<(f64, f64)> {
        let (x, y) = self.projection.of_ray(ray)?;
        self.distorted(x, y)
    }

    /// The photo's position of an ideal point in normalised coordinates.
    #[inline]
    fn distorted(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        let Intrinsics { fx, fy, cx, cy } = self.intrinsics;
        if x * x + y * y > self.valid_radius2 {
            return None;
        }
        let (x, y) = self.distortion.apply(x, y);
        let (u, v) = (x * fx + cx, y * fy + cy);
        (u >= 0.0 && u <= self.width && v >= 0.0 && v <= self.height).then_some((u, v))
    }
}

/// The colour (0 to 255) at a position inside the photo, in pixels from the corner: bilinear between pixel centres, the
/// border pixels' colour in the outermost half pixel.
#[inline]
pub(crate) fn sample(photo: &Photo, u: f64, v: f64) -> [f32; 3] {
    match photo {
        Photo::Rgb8(image) => bilinear(image.as_raw(), photo.size(), u, v, f32::from),
        Photo::Rgb32(image) => bilinear(image.as_raw(), photo.size(), u, v, |value| 255.0 * value),
    }
}

/// Bilinear interpolation in `[height, width, 3]` data.
#[inline]
fn bilinear<T: Copy>(data: &[T], size: (usize, usize), u: f64, v: f64, value: impl Fn(T) -> f32) -> [f32; 3] {
    let (width, height) = size;
    let (x, y) = ((u - 0.5).max(0.0) as f32, (v - 0.5).max(0.0) as f32);
    let (x0, y0) = ((x as u32 as usize).min(width - 1), (y as u32 as usize).min(height - 1));
    let (right, down) = (3 * usize::from(x0 + 1 < width), 3 * width * usize::from(y0 + 1 < height));
    let (tx, ty) = (x - x0 as f32, y - y0 as f32);
    let start = 3 * (y0 * width + x0);
    let top = &data[start..start + right + 3];
    let bottom = &data[start + down..start + down + right + 3];
    let mut out = [0.0; 3];
    for (i, out) in out.iter_mut().enumerate() {
        let (a, b, c, d) = (value(top[i]), value(top[i + right]), value(bottom[i]), value(bottom[i + right]));
        let upper = a + tx * (b - a);
        let lower = c + tx * (d - c);
        *out = upper + ty * (lower - upper);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lens(k1: f64) -> Distortion {
        Distortion { k: [k1, 0.0, 0.0, 0.0], ..Distortion::default() }
    }

    #[test]
    fn without_distortion_there_is_nothing_to_undo() {
        let intrinsics = Intrinsics { fx: 10.0, fy: 10.0, cx: 5.0, cy: 5.0 };
        assert!(Undistortion::new(lens(0.0), intrinsics, (10, 10)).is_none());
    }

    #[test]
    fn one_point_by_hand() {
        // x = 0.5, y = 0: r2 = 0.25, g = 1 + 0.2 * 0.25 = 1.05, so x' = 0.525.
        let intrinsics = Intrinsics { fx: 100.0, fy: 100.0, cx: 100.0, cy: 50.0 };
        let undo = Undistortion::new(lens(0.2), intrinsics, (200, 100)).expect("distorted");
        let (u, v) = undo.observed(150.0, 50.0).expect("inside");
        assert!((u - 152.5).abs() < 1e-9 && (v - 50.0).abs() < 1e-9);
        assert!(undo.observed(200.0, 100.0).is_none(), "the corner is observed outside the photo");
    }

    #[test]
    fn a_folding_lens_is_cut_at_the_fold() {
        // r (1 - r^2) grows up to r = 1/sqrt(3); beyond that it shows the photo a second time.
        let intrinsics = Intrinsics { fx: 100.0, fy: 100.0, cx: 100.0, cy: 100.0 };
        let undo = Undistortion::new(lens(-1.0), intrinsics, (200, 200)).expect("distorted");
        assert!(undo.observed(155.0, 100.0).is_some());
        assert!(undo.observed(160.0, 100.0).is_none());
    }
}
