//! How a file describes a lens, and what that means for an image of a given size.

use std::ops::RangeInclusive;
use std::path::Path;

use crate::error::DatasetError;
use crate::frame::Intrinsics;
use crate::names::some_names;
use crate::plural::counted;

/// Largest difference between declared and actual proportions that is put down to rounding when someone resized the
/// images: one pixel of a hundred. Beyond it the image was cropped or turned, and no scaling makes the intrinsics fit.
const ASPECT_TOLERANCE: f64 = 0.01;

/// Focal lengths of lenses that are pinholes to us, in image sides: from 179 degrees across to a telescope's.
const FOCAL_SIDES: RangeInclusive<f64> = 0.01..=1e4;

/// Farthest principal point from the middle, image sides: a photo may be a crop of a larger one, and is then a fifth of it at least.
const CENTRE_SIDES: f64 = 2.0;

/// A focal length as the file writes it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Focal {
    /// Pixels of the declared size.
    Pixels(f64),
    /// Full angle of view along this axis, radians.
    Angle(f64),
}

impl Focal {
    fn pixels(self, size: f64) -> f64 {
        match self {
            Self::Pixels(pixels) => pixels,
            Self::Angle(angle) => 0.5 * size / (0.5 * angle).tan(),
        }
    }

    fn shown(self) -> String {
        match self {
            Self::Pixels(pixels) => in_pixels(pixels),
            Self::Angle(angle) => format!("an angle of {angle:?} radians"),
        }
    }
}

/// "960.0 pixels", "1e300 pixels": the debug format of a number shortens large ones, which otherwise fill lines with zeros.
fn in_pixels(value: f64) -> String {
    format!("{value:?} pixels")
}

/// Lens parameters before the image's size is known. What is `None` takes its value from the image.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Lens {
    /// At least one of the two axes; the other copies it (square pixels).
    pub focal_x: Option<Focal>,
    pub focal_y: Option<Focal>,
    pub cx: Option<f64>,
    pub cy: Option<f64>,
    /// Size that pixel values above belong to.
    pub width: Option<f64>,
    pub height: Option<f64>,
    pub distortion: Distortion,
}

/// Intrinsics for an image's actual size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Resolved {
    pub intrinsics: Intrinsics,
    /// The declared size, where the file's intrinsics had to be rescaled from it.
    pub rescaled_from: Option<(f64, f64)>,
    /// The principal point is not inside the photo: of a crop, or the intrinsics are for another size and do not say which.
    pub off_photo: bool,
}

/// The sentence about views whose principal point is not inside their photo, where there are any.
pub(crate) fn off_photo_warning(scene: &Path, views: &[&str]) -> Option<String> {
    (!views.is_empty()).then(|| {
        format!(
            "{}: the principal point (cx, cy) of {} is not inside the photo; if the intrinsics are for photos of another size, \
             w and h must say which ({})",
            scene.display(),
            counted(views.len(), "view"),
            some_names(views)
        )
    })
}

impl Lens {
    /// The size the file declares; a side it leaves out follows from the image's proportions.
    fn declared_size(&self, actual: (u32, u32)) -> (f64, f64) {
        let (w, h) = (f64::from(actual.0), f64::from(actual.1));
        match (self.width, self.height) {
            (Some(width), Some(height)) => (width, height),
            (Some(width), None) => (width, width * h / w),
            (None, Some(height)) => (height * w / h, height),
            (None, None) => (w, h),
        }
    }

    /// Intrinsics for an image of `actual` pixels.
    pub fn resolve(&self, actual: (u32, u32), image: &Path, file: &Path) -> Result<Resolved, DatasetError> {
        let (width, height) = self.declared_size(actual);
        let (scale_x, scale_y) = (f64::from(actual.0) / width, f64::from(actual.1) / height);
        if (scale_x / scale_y - 1.0).abs() > ASPECT_TOLERANCE {
            let turned = (scale_x * width * width / (scale_y * height * height) - 1.0).abs() < ASPECT_TOLERANCE;
            return Err(DatasetError::SizeMismatch {
                path: image.to_path_buf(),
                declared_in: file.to_path_buf(),
                declared: (width, height),
                actual,
                hint: if turned { " (turned by 90 degrees? EXIF rotation is not applied)" } else { "" },
            });
        }
        let intrinsics = self.intrinsics(width, height).ok_or_else(|| {
            DatasetError::malformed(
                file,
                format!("intrinsics of {}", image.display()),
                "focal lengths of 0.01 to 10000 image sides and a principal point within two sides of the middle",
                self.shown(),
            )
        })?;
        let rescaled = (scale_x - 1.0).abs() > 1e-9 || (scale_y - 1.0).abs() > 1e-9;
        let outside = |centre: f64, side: f64| !(centre > 0.0 && centre < side);
        Ok(Resolved {
            off_photo: outside(intrinsics.cx, width) || outside(intrinsics.cy, height),
            intrinsics: intrinsics.scaled(scale_x, scale_y),
            rescaled_from: rescaled.then_some((width, height)),
        })
    }

    /// Focal lengths and principal point as the file gives them, for a message.
    fn shown(&self) -> String {
        let given = |value: Option<String>| value.unwrap_or_else(|| "not given".into());
        let focal = |focal: Option<Focal>| given(focal.map(Focal::shown));
        let centre = |pixels: Option<f64>| given(pixels.map(in_pixels));
        format!(
            "focal lengths {} (x) and {} (y), principal point {} (x) and {} (y)",
            focal(self.focal_x),
            focal(self.focal_y),
            centre(self.cx),
            centre(self.cy)
        )
    }

    /// Intrinsics for the declared size; `None` when they are no camera's, or that of photos of quite another size.
    pub fn intrinsics(&self, width: f64, height: f64) -> Option<Intrinsics> {
        let x = self.focal_x.map(|focal| focal.pixels(width));
        let y = self.focal_y.map(|focal| focal.pixels(height));
        let (fx, fy) = (x.or(y)?, y.or(x)?);
        let (cx, cy) = (self.cx.unwrap_or(0.5 * width), self.cy.unwrap_or(0.5 * height));
        let sound = |focal: f64, centre: f64, side: f64| {
            FOCAL_SIDES.contains(&(focal / side)) && (centre / side - 0.5).abs() <= CENTRE_SIDES
        };
        (sound(fx, cx, width) && sound(fy, cy, height)).then_some(Intrinsics { fx, fy, cx, cy })
    }
}

/// The OpenCV lens model, from ideal to observed normalised coordinates (`r2 = x^2 + y^2`):
///
/// ```text
/// g  = (1 + k1 r2 + k2 r2^2 + k3 r2^3 + k4 r2^4) / (1 + d1 r2 + d2 r2^2 + d3 r2^3)
/// x' = x g + 2 p1 x y + p2 (r2 + 2 x^2)
/// y' = y g + p1 (r2 + 2 y^2) + 2 p2 x y
/// ```
///
/// Every pinhole and radial model is a case of it: COLMAP's RADIAL has k1 and k2, OPENCV adds p1 and p2, FULL_OPENCV
/// adds k3 and d (its k4..k6); nerfstudio's polynomial has k1..k4.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Distortion {
    /// k1 to k4.
    pub k: [f64; 4],
    /// d1 to d3.
    pub d: [f64; 3],
    /// p1 and p2.
    pub p: [f64; 2],
}

impl Distortion {
    /// Whether the lens is an ideal pinhole.
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Whether all coefficients are finite.
    pub fn is_finite(&self) -> bool {
        self.k.iter().chain(&self.d).chain(&self.p).all(|value| value.is_finite())
    }

    /// The observed position of the ideal point (x, y), both in normalised coordinates.
    pub fn apply(&self, x: f64, y: f64) -> (f64, f64) {
        let r2 = x * x + y * y;
        let g = self.radial(r2);
        let [p1, p2] = self.p;
        (x * g + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), y * g + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y)
    }

    fn radial(&self, r2: f64) -> f64 {
        let [k1, k2, k3, k4] = self.k;
        let [d1, d2, d3] = self.d;
        let g = 1.0 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4)));
        // A division is a third of the work per pixel, and only FULL_OPENCV needs it.
        if self.d == [0.0; 3] { g } else { g / (1.0 + r2 * (d1 + r2 * (d2 + r2 * d3))) }
    }

    /// The squared radius up to which the observed radius `r g(r^2)` grows with the ideal radius `r`, at most `limit`.
    /// Beyond it the polynomial folds back and would show parts of the photo a second time.
    pub(crate) fn valid_radius2(&self, limit: f64) -> f64 {
        const STEPS: usize = 1024;
        let end = limit.sqrt();
        let mut last = 0.0;
        for step in 1..=STEPS {
            let r = end * step as f64 / STEPS as f64;
            let observed = r * self.radial(r * r);
            // NaN is a pole of the rational form and ends the search too.
            if observed.is_nan() || observed <= last {
                let before = end * (step - 1) as f64 / STEPS as f64;
                return before * before;
            }
            last = observed;
        }
        limit
    }
}
