//! Photos in linear light: those in floats, which are OpenEXR, Radiance HDR and some TIFF files. Integers are taken as
//! they are encoded.
//!
//! They are brought to sRGB when they are decoded, and what is brighter than white is white, as on a display. So the
//! loss, the measures, the previews and the exported colours have one space, which viewers expect. Left aside: a loss
//! in linear light, in which highlights outweigh everything else and a shadow counts next to nothing.

use std::path::Path;

use image::{DynamicImage, Rgb32FImage, Rgba32FImage};

use crate::behind::Behind;
use crate::error::DatasetError;
use crate::exr_file;
use crate::light::{to_encoded, to_linear};
use crate::map::Map;

/// The channels of a photo in an OpenEXR file, best first.
const COLORS: &[&[&str]] = &[&["R", "G", "B", "A"], &["R", "G", "B"], &["Y"]];

/// The photo in an OpenEXR file.
pub(crate) fn decode_exr(path: &Path, bytes: &[u8]) -> Result<DynamicImage, DatasetError> {
    let window = exr_file::size(path, bytes)?;
    let Map { width, height, channels, values } = exr_file::parse(path, bytes, COLORS)?;
    let (w, h) = (width as u32, height as u32);
    let image = match channels {
        4 => Rgba32FImage::from_raw(w, h, values).map(DynamicImage::ImageRgba32F),
        3 => Rgb32FImage::from_raw(w, h, values).map(DynamicImage::ImageRgb32F),
        _ => Rgb32FImage::from_raw(w, h, values.iter().flat_map(|grey| [*grey; 3]).collect())
            .map(DynamicImage::ImageRgb32F),
    };
    // A crop has another principal point than its camera.
    image.filter(|_| (w, h) == window).ok_or_else(|| {
        let expected = format!("pixels for the whole image of {} x {}", window.0, window.1);
        DatasetError::malformed(path, "OpenEXR", expected, format!("a data window of {width} x {height}"))
    })
}

/// Whether the values are light.
pub(crate) fn is_light(image: &DynamicImage) -> bool {
    matches!(image, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_))
}

/// The number of values of a photo in linear light that are no number.
pub(crate) fn unknown(image: &DynamicImage) -> usize {
    let count = |values: &[f32]| values.iter().filter(|value| value.is_nan()).count();
    match image {
        DynamicImage::ImageRgb32F(image) => count(image.as_raw()),
        DynamicImage::ImageRgba32F(image) => count(image.as_raw()),
        _ => 0,
    }
}

/// Share of the pixels of a photo in linear light that are brighter than white; `None` of another photo.
pub(crate) fn clipped(image: &DynamicImage, behind: Behind) -> Option<f64> {
    let white = behind.levels.map_or(1.0, |[_, white]| white as f32);
    let share = |values: &[f32], channels: usize| {
        let count = values.chunks_exact(channels).filter(|pixel| pixel[..3].iter().any(|light| *light > white)).count();
        count as f64 / (values.len() / channels).max(1) as f64
    };
    match image {
        DynamicImage::ImageRgb32F(image) => Some(share(image.as_raw(), 3)),
        DynamicImage::ImageRgba32F(image) => Some(share(image.as_raw(), 4)),
        _ => None,
    }
}

/// The photo in sRGB, its light between the levels. Alpha is a share of light, by which colours are multiplied already,
/// as OpenEXR has it.
pub(crate) fn displayed(image: DynamicImage, behind: Behind) -> Rgb32FImage {
    let rgba = image.into_rgba32f();
    let mut rgb = Rgb32FImage::new(rgba.width(), rgba.height());
    for (out, pixel) in rgb.pixels_mut().zip(rgba.pixels()) {
        let gap = 1.0 - pixel.0[3].clamp(0.0, 1.0);
        for (channel, out) in out.0.iter_mut().enumerate() {
            let light = behind.stretch(pixel.0[channel]).clamp(0.0, 1.0) + gap * to_linear(behind.color[channel]);
            *out = to_encoded(light.min(1.0));
        }
    }
    rgb
}
