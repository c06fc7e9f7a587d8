//! How a file describes a lens, and what that means for an image of a given size.

use std::f64::consts::{PI, TAU};
use std::ops::RangeInclusive;
use std::path::Path;

use gs_base::Intrinsics;
use gs_base::sentence::{decimals, number};

use crate::distortion::Distortion;
use crate::error::DatasetError;
use crate::fold::{self, Fault};
use crate::projection::Projection;

/// Largest difference between declared and actual proportions that is put down to rounding when someone resized the
/// images: one pixel of a hundred. Beyond it the image was cropped or turned, and no scaling makes the intrinsics fit.
const ASPECT_TOLERANCE: f64 = 0.01;

/// Focal lengths of lenses that are pinholes to us, in image sides: from 179 degrees across to a telescope's.
const FOCAL_SIDES: RangeInclusive<f64> = 0.01..=1e4;

/// Farthest principal point from the middle, image sides: a photo may be a crop of a larger one, and is then a fifth of
/// it at least.
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

/// "960.0 pixels", "1e300 pixels": the debug format of a number shortens large ones, which otherwise fill lines with
/// zeros.
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
    /// A panorama has no focal length and no principal point: its longitudes and latitudes fill the photo.
    pub projection: Projection,
    pub distortion: Distortion,
}

/// Intrinsics for an image's actual size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Resolved {
    pub intrinsics: Intrinsics,
    /// The declared size, where the file's intrinsics had to be rescaled from it.
    pub rescaled_from: Option<(f64, f64)>,
    /// The principal point is not inside the photo: of a crop, or the intrinsics are for another size and do not say
    /// which.
    pub off_photo: bool,
}

impl Lens {
    /// A pinhole whose values are all given: fx, fy, cx and cy in pixels of a photo of `size`.
    pub fn of([fx, fy, cx, cy]: [f64; 4], size: (f64, f64), distortion: Distortion) -> Self {
        Self {
            focal_x: Some(Focal::Pixels(fx)),
            focal_y: Some(Focal::Pixels(fy)),
            cx: Some(cx),
            cy: Some(cy),
            width: Some(size.0),
            height: Some(size.1),
            projection: Projection::Pinhole,
            distortion,
        }
    }

    /// Whether photos are those of a pinhole as they are.
    pub fn is_ideal(&self) -> bool {
        self.projection == Projection::Pinhole && self.distortion.is_none()
    }

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
        if let Some(fault) = fold::fault(self.projection, &self.distortion, intrinsics, (width, height)) {
            return Err(self.diverged(fault, intrinsics, image, file));
        }
        let rescaled = (scale_x - 1.0).abs() > 1e-9 || (scale_y - 1.0).abs() > 1e-9;
        let outside = |centre: f64, side: f64| !(centre > 0.0 && centre < side);
        Ok(Resolved {
            off_photo: outside(intrinsics.cx, width) || outside(intrinsics.cy, height),
            intrinsics: intrinsics.scaled(scale_x, scale_y),
            rescaled_from: rescaled.then_some((width, height)),
        })
    }

    fn diverged(&self, fault: Fault, intrinsics: Intrinsics, image: &Path, file: &Path) -> DatasetError {
        let Distortion { k, d, p, s } = self.distortion;
        let named = |name: &'static str, values: &[f64]| -> Vec<String> {
            let values = values.iter().enumerate().filter(|(_, value)| **value != 0.0);
            values.map(|(i, value)| format!("{name}{} {}", i + 1, number(*value))).collect()
        };
        // FULL_OPENCV calls its denominator k4 to k6.
        let divisor = d
            .iter()
            .zip(4..)
            .filter(|(value, _)| **value != 0.0)
            .map(|(value, i)| format!("k{i} {} below", number(*value)));
        let further = divisor.chain(named("p", &p)).chain(named("s", &s));
        let coefficients: Vec<String> = named("k", &k).into_iter().chain(further).collect();
        let how = match fault {
            Fault::Folds { radius, share } => format!(
                "one that folds back {} focal lengths ({} pixels) from the principal point, so that it cannot show \
                 {:.0} % of the photo",
                decimals(radius, 4),
                decimals(radius * intrinsics.fx, 1),
                100.0 * share
            ),
            Fault::Stretches(times) => {
                format!("one that moves the corner of the photo {} times as far out", decimals(times, 1))
            }
        };
        let found = format!("{how} ({}): the calibration diverged", coefficients.join(", "));
        let location = format!("frame {:?}", image.display().to_string());
        DatasetError::malformed(file, location, "a lens that shows each part of the photo once", found)
    }

    /// The pinhole of the lens's focal lengths and principal point, for an image of `size` pixels to be rendered.
    /// `file` gives them.
    pub fn pinhole(&self, size: (u32, u32), file: &Path) -> Result<Intrinsics, DatasetError> {
        if self.projection == Projection::Equirectangular {
            return Err(DatasetError::Unsupported {
                path: file.to_path_buf(),
                what: "an equirectangular camera for rendering".to_string(),
                expected: "cameras with a focal length".to_string(),
            });
        }
        Ok(self.resolve(size, file, file)?.intrinsics)
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
        if self.projection == Projection::Equirectangular {
            return Some(Intrinsics { fx: width / TAU, fy: height / PI, cx: 0.5 * width, cy: 0.5 * height });
        }
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
