//! Removing lens distortion: for each pixel of the ideal pinhole image, where the photo shows it.
//!
//! The ideal image has the photo's size and fx, fy, cx, cy. The lens model runs forward (ideal to observed), so nothing
//! is inverted. Colours are interpolated between the four pixels around the observed position; ideal pixels whose
//! observed position lies outside the photo, or where the lens model folds back on itself, have no colour and are
//! masked out.

use gs_base::Intrinsics;

use crate::distortion::Distortion;
use crate::pixels::Photo;

/// Most by which [`Undistortion::filling`] enlarges the focal lengths. A lens that needs more would lose three quarters
/// of the photo.
const ZOOM_MAX: f64 = 2.0;

/// Halvings of the interval of enlargements: the last one moves no pixel of an image with 65 535 columns by a hundredth
/// of its width.
const ZOOM_STEPS: usize = 24;

/// From ideal pixels to positions in the photo.
#[derive(Debug, Clone, PartialEq)]
pub struct Undistortion {
    distortion: Distortion,
    intrinsics: Intrinsics,
    /// 1/fx and 1/fy.
    inverse: (f64, f64),
    width: f64,
    height: f64,
    valid_radius2: f64,
}

impl Undistortion {
    /// For a photo of `size` pixels with these intrinsics; `None` when there is nothing to undo, or the
    /// ideal image has no end.
    pub(crate) fn new(distortion: Distortion, intrinsics: Intrinsics, size: (usize, usize)) -> Option<Self> {
        if distortion.is_none() { None } else { Self::of(distortion, intrinsics, size) }
    }

    /// `None` when the ideal image has no end.
    fn of(distortion: Distortion, intrinsics: Intrinsics, size: (usize, usize)) -> Option<Self> {
        let (width, height) = (size.0 as f64, size.1 as f64);
        // The limit of the search for a fold; the ideal image shows no more than this.
        let far = |side: f64, c: f64, f: f64| (c / f).abs().max(((side - c) / f).abs());
        let (x, y) = (far(width, intrinsics.cx, intrinsics.fx), far(height, intrinsics.cy, intrinsics.fy));
        let inverse = (1.0 / intrinsics.fx, 1.0 / intrinsics.fy);
        let valid_radius2 = distortion.valid_radius2(x * x + y * y);
        let this = Self { distortion, intrinsics, inverse, width, height, valid_radius2 };
        (x.is_finite() && y.is_finite()).then_some(this)
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

    /// Width and height of the photo and of the ideal image, pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.width as usize, self.height as usize)
    }

    /// The photo's position of the ideal image's point (u, v), in pixels from the corner; `None` outside the photo.
    pub fn observed(&self, u: f64, v: f64) -> Option<(f64, f64)> {
        let Intrinsics { fx, fy, cx, cy } = self.intrinsics;
        let (x, y) = ((u - cx) * self.inverse.0, (v - cy) * self.inverse.1);
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
