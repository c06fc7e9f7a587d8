//! Which part of a photo a processed image shows, and at what size.
//!
//! VGGT and OmniVGGT resize a photo and then crop or pad it. A position in the processed image is `scale * position in the photo +
//! offset`, both in pixels from the corner; the inverse subtracts the offset and then divides.
//!
//! | fit | scale | offset |
//! |---|---|---|
//! | crop (the usual) | width to 518, height to the nearest multiple of 14 | half of what is over 518 rows, negative |
//! | pad | longer side to 518, the other to a multiple of 14 | half of the border |
//! | stretch | each side by itself | 0 |

use std::path::Path;
use std::str::FromStr;

use crate::error::DatasetError;

/// Side of the network's patches, pixels: sizes are multiples of it.
const PATCH: f64 = 14.0;

/// Proportions that differ by less are those of one photo: a side rounded to 14 pixels of 280 is off by 2.5 % at most.
const SAME_SHAPE: f64 = 0.026;

/// How photos were fitted into the processed size.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Fit {
    /// Told from sizes, and from predicted focal lengths where sizes leave a choice.
    #[default]
    Auto,
    /// Resized to the width, cropped around the centre if then too high.
    Crop,
    /// Resized to fit and padded on both sides.
    Pad,
    /// Resized in each direction by itself.
    Stretch,
}

impl FromStr for Fit {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "crop" => Ok(Self::Crop),
            "pad" => Ok(Self::Pad),
            "stretch" => Ok(Self::Stretch),
            _ => Err(format!("expected auto, crop, pad or stretch, found {text:?}")),
        }
    }
}

/// The way from a photo's pixels to those of its processed image, along x and y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Window {
    /// Processed pixels for each pixel of the photo.
    pub scale: (f64, f64),
    /// Added after scaling, processed pixels.
    pub offset: (f64, f64),
}

impl Window {
    /// The position in the processed image of a position in the photo, both in pixels from the corner.
    pub fn to_processed(self, x: f64, y: f64) -> (f64, f64) {
        (self.scale.0 * x + self.offset.0, self.scale.1 * y + self.offset.1)
    }
}

/// The window of a photo of size `photo` in a processed image of size `processed` (width, height). `focal` is the known focal length over
/// the predicted one, along x and y, in pixels of photo and processed image.
///
/// # Errors
/// When a fit cannot have made this size.
pub(super) fn window(
    fit: Fit,
    photo: (usize, usize),
    processed: (usize, usize),
    focal: Option<(f64, f64)>,
    label: &Path,
) -> Result<Window, DatasetError> {
    let made = |fit| match fit {
        Fit::Crop => crop(photo, processed),
        Fit::Pad => pad(photo, processed),
        _ => Some(stretch(photo, processed)),
    };
    let found = if fit == Fit::Auto { guess(photo, processed, focal) } else { made(fit) };
    found.ok_or_else(|| {
        let expected = format!(
            "a size that a photo of {} x {} pixels is cropped or padded to (--fit says which)",
            photo.0, photo.1
        );
        DatasetError::malformed(label, "processed size", expected, format!("{} x {}", processed.0, processed.1))
    })
}

/// The fit that can have made the size; where both cropping and padding can, that whose focal length is nearer the known one.
fn guess(photo: (usize, usize), processed: (usize, usize), focal: Option<(f64, f64)>) -> Option<Window> {
    let ratio = processed.0 as f64 * photo.1 as f64 / (processed.1 as f64 * photo.0 as f64);
    if (ratio - 1.0).abs() < SAME_SHAPE {
        return Some(stretch(photo, processed));
    }
    match (crop(photo, processed), pad(photo, processed), focal) {
        (Some(crop), Some(pad), Some((x, y))) => {
            let off = |window: &Window| (window.scale.0 * x).ln().abs() + (window.scale.1 * y).ln().abs();
            Some(if off(&pad) < off(&crop) { pad } else { crop })
        }
        (crop, pad, _) => crop.or(pad),
    }
}

fn stretch(photo: (usize, usize), processed: (usize, usize)) -> Window {
    let scale = (processed.0 as f64 / photo.0 as f64, processed.1 as f64 / photo.1 as f64);
    Window { scale, offset: (0.0, 0.0) }
}

/// A side in proportion, rounded to whole patches.
fn patched(side: f64) -> f64 {
    (side / PATCH).round_ties_even().max(1.0) * PATCH
}

fn crop(photo: (usize, usize), processed: (usize, usize)) -> Option<Window> {
    let scale = processed.0 as f64 / photo.0 as f64;
    let resized = patched(photo.1 as f64 * scale);
    // A photo that is lower than the processed image was padded.
    let over = resized - processed.1 as f64;
    (over >= 0.0).then(|| Window { scale: (scale, resized / photo.1 as f64), offset: (0.0, -(over / 2.0).floor()) })
}

fn pad(photo: (usize, usize), processed: (usize, usize)) -> Option<Window> {
    let (width, height) = (processed.0 as f64, processed.1 as f64);
    let fitted = if width * photo.1 as f64 >= height * photo.0 as f64 {
        (patched(photo.0 as f64 * height / photo.1 as f64).min(width), height)
    } else {
        (width, patched(photo.1 as f64 * width / photo.0 as f64).min(height))
    };
    let offset = (((width - fitted.0) / 2.0).floor(), ((height - fitted.1) / 2.0).floor());
    Some(Window { scale: (fitted.0 / photo.0 as f64, fitted.1 / photo.1 as f64), offset })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn auto(photo: (usize, usize), processed: (usize, usize), focal: Option<(f64, f64)>) -> Window {
        window(Fit::Auto, photo, processed, focal, Path::new("depth.npy")).expect("a window")
    }

    #[test]
    fn a_wide_photo_is_resized_alone() {
        // 294 rows are 21 patches; 1080 * 518 / 1920 is 291.4.
        let window = auto((1920, 1080), (518, 294), None);
        assert_eq!((window.offset, window.scale), ((0.0, 0.0), (518.0 / 1920.0, 294.0 / 1080.0)));
    }

    #[test]
    fn a_high_photo_is_cropped_or_padded() {
        // 600 x 900 becomes 518 x 777 (55.5 patches, so 56: 784), of which 266 rows are over.
        let crop = auto((600, 900), (518, 518), None);
        assert_eq!(crop.offset, (0.0, -133.0));
        assert_eq!(crop.to_processed(300.0, 450.0), (259.0, 259.0), "the centre stays");
        // Padded, it is 345.3 wide (24.7 patches, so 25: 350). The focal length tells: 500 in the photo are 288 after padding.
        let pad = auto((600, 900), (518, 518), Some((500.0 / 288.0, 500.0 / 288.0)));
        assert_eq!(pad.offset, (84.0, 0.0));
        assert_eq!(pad.to_processed(300.0, 450.0), (259.0, 259.0));
        assert!(auto((600, 900), (518, 518), Some((500.0 / 431.0, 500.0 / 431.0))) == crop);
    }

    #[test]
    fn a_wide_photo_in_a_square_is_padded() {
        // 518 * 720 / 1280 is 291.4, 21 patches of 14.
        let pad = auto((1280, 720), (518, 518), None);
        assert_eq!(pad.offset, (0.0, 112.0));
        assert!(window(Fit::Crop, (1280, 720), (518, 518), None, Path::new("x")).is_err(), "a crop is never higher");
    }
}
