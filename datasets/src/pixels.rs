//! Decoding photos: opaque colour out, transparency composited on the chosen background.

use std::io::{BufRead, BufReader, Cursor, Seek};
use std::path::Path;

use gs_base::{counted, guarded};
use image::metadata::Orientation;
use image::{ColorType, DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits};

use crate::behind::Behind;
use crate::error::DatasetError;
use crate::exr_file;
use crate::foreign::Foreign;
use crate::jpeg;
use crate::linear;

/// Longest side of an image that is opened. Larger ones are broken headers rather than photos.
const SIDE_MAX: u32 = 65_535;

/// Most memory that decoding one image may take, bytes. Room for 250 megapixels.
const DECODE_MAX: u64 = 1 << 30;

/// Most decoded bytes for each byte of a file: deflate makes at most 1032 bytes of one, and of a palette of two colours
/// each is eight pixels of three bytes. A header that asks for more is broken, and its memory is asked for before the
/// pixels are looked at.
const DECODED_PER_BYTE: u64 = 1032 * 24;

/// The finding about a file of no bytes, as a copy that was interrupted leaves it.
const EMPTY: &str = "an empty file";

/// A decoded photo without transparency.
pub(crate) enum Photo {
    /// Most photos; kept in bytes to be lean.
    Rgb8(image::RgbImage),
    /// Values 0 to 1: composited images, 16-bit images, images in linear light brought to sRGB.
    Rgb32(image::Rgb32FImage),
}

impl Photo {
    /// Width and height, pixels; neither is 0.
    pub fn size(&self) -> (usize, usize) {
        let (width, height) = match self {
            Self::Rgb8(image) => image.dimensions(),
            Self::Rgb32(image) => image.dimensions(),
        };
        (width as usize, height as usize)
    }

    /// Writes the colours (0 to 255) of row `y` (inside the image) to `row`, `[width, 3]`.
    pub fn copy_row(&self, y: usize, row: &mut [f32]) {
        let start = y * row.len();
        match self {
            Self::Rgb8(image) => {
                row.iter_mut().zip(&image.as_raw()[start..]).for_each(|(out, value)| *out = f32::from(*value));
            }
            Self::Rgb32(image) => {
                row.iter_mut().zip(&image.as_raw()[start..]).for_each(|(out, value)| *out = 255.0 * value);
            }
        }
    }
}

/// Opens an image file within limits. The format is told from the content, because wrong extensions are common.
pub(crate) fn decode(path: &Path) -> Result<DynamicImage, DatasetError> {
    decode_bytes(path, &guarded::read(path, guarded::IMAGE_MAX)?)
}

/// Decodes the content of an image file within limits; `path` is for messages.
fn decode_bytes(path: &Path, bytes: &[u8]) -> Result<DynamicImage, DatasetError> {
    let is_exr = bytes.starts_with(exr_file::MAGIC);
    let image = if is_exr { linear::decode_exr(path, bytes)? } else { decode_others(path, bytes)? };
    match linear::unknown(&image) {
        0 => Ok(image),
        count => {
            let found = format!("an image with {} (NaN)", counted(count, "value that is no number"));
            Err(DatasetError::Image { path: path.to_path_buf(), found })
        }
    }
}

/// Decodes any image but OpenEXR.
fn decode_others(path: &Path, bytes: &[u8]) -> Result<DynamicImage, DatasetError> {
    let mut reader = ImageReader::new(Cursor::new(bytes));
    reader = reader.with_guessed_format().map_err(|error| DatasetError::read(path, error))?;
    reader.limits(limits());
    let wrong = |found: String| DatasetError::Image { path: path.to_path_buf(), found };
    if bytes.is_empty() {
        return Err(wrong(EMPTY.to_string()));
    }
    const READ: [ImageFormat; 5] =
        [ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::WebP, ImageFormat::Tiff, ImageFormat::Hdr];
    let is_read = reader.format().is_some_and(|format| READ.contains(&format));
    if let Some(foreign) = Foreign::of_bytes(bytes).filter(|_| !is_read) {
        return Err(wrong(foreign.advice()));
    }
    // The decoder fills what is missing with grey and says nothing.
    if reader.format() == Some(ImageFormat::Jpeg) && !jpeg::is_whole(bytes) {
        return Err(wrong(format!("a JPEG cut short, of {} bytes", bytes.len())));
    }
    let decoder = reader.into_decoder().map_err(|error| wrong(error.to_string()))?;
    let (width, height) = decoder.dimensions();
    if decoder.total_bytes() / DECODED_PER_BYTE > bytes.len() as u64 {
        return Err(wrong(format!("a header of {width} x {height} pixels on a file of {} bytes", bytes.len())));
    }
    // Not every decoder asks its limits before it answers with an image.
    if decoder.total_bytes() > DECODE_MAX {
        return Err(wrong(format!("an image of {width} x {height} pixels, which takes more than 1 GiB")));
    }
    let image = DynamicImage::from_decoder(decoder).map_err(|error| wrong(error.to_string()))?;
    if image.width() == 0 || image.height() == 0 {
        return Err(wrong(format!("an image of {} x {} pixels", image.width(), image.height())));
    }
    Ok(image)
}

fn limits() -> Limits {
    let mut limits = Limits::default();
    limits.max_image_width = Some(SIDE_MAX);
    limits.max_image_height = Some(SIDE_MAX);
    limits.max_alloc = Some(DECODE_MAX);
    limits
}

/// Width and height from the file's header.
pub(crate) fn size_of(path: &Path) -> Result<(u32, u32), DatasetError> {
    // The decoder reads a JPEG whole before it looks at the header, and a log of some GB would be read whole to be
    // described.
    let mut file = BufReader::new(guarded::open_regular(path, guarded::IMAGE_MAX)?);
    let start = file.fill_buf().unwrap_or_default();
    if start.is_empty() {
        return Err(DatasetError::Image { path: path.to_path_buf(), found: EMPTY.to_string() });
    }
    if start.starts_with(exr_file::MAGIC) {
        return exr_file::size(path, file);
    }
    if let Some(size) = jpeg::size(&mut file) {
        return Ok(size);
    }
    file.rewind().map_err(|error| DatasetError::read(path, error))?;
    let reader = ImageReader::new(file).with_guessed_format().map_err(|error| DatasetError::read(path, error))?;
    reader.into_dimensions().map_err(|error| DatasetError::Image { path: path.to_path_buf(), found: error.to_string() })
}

/// Whether the file says by EXIF that its pixels are to be turned or mirrored when they are shown. Nothing here does
/// that: poses and intrinsics are of the pixels as stored, in COLMAP's and nerfstudio's data sets. `false` where
/// nothing is said or the file cannot be read.
pub(crate) fn is_turned(path: &Path) -> bool {
    let Ok(file) = guarded::open_regular(path, guarded::IMAGE_MAX) else { return false };
    let Ok(mut reader) = ImageReader::new(BufReader::new(file)).with_guessed_format() else { return false };
    reader.limits(limits());
    let orientation = reader.into_decoder().and_then(|mut decoder| decoder.orientation());
    orientation.is_ok_and(|orientation| orientation != Orientation::NoTransforms)
}

/// Whether a photo has more than 8 bits a channel, by its header; `false` where that cannot be read.
pub(crate) fn is_deep(path: &Path) -> bool {
    let Ok(mut file) = guarded::open_regular(path, guarded::IMAGE_MAX).map(BufReader::new) else { return false };
    if file.fill_buf().is_ok_and(|start| start.starts_with(exr_file::MAGIC)) {
        return true;
    }
    // No JPEG has more, and the decoder would read it whole.
    if jpeg::size(&mut file).is_some() || file.rewind().is_err() {
        return false;
    }
    let Ok(mut reader) = ImageReader::new(file).with_guessed_format() else { return false };
    reader.limits(limits());
    reader.into_decoder().is_ok_and(|decoder| has_more_than_bytes(decoder.color_type()))
}

fn has_more_than_bytes(color: ColorType) -> bool {
    color.bytes_per_pixel() > color.channel_count()
}

/// Opens a photo and composites it on the background `behind`: `rgb * alpha + background * (1 - alpha)`, straight
/// alpha, in floats and before any resampling. Resampling first would mix in the hidden colour of transparent pixels.
pub(crate) fn open(path: &Path, behind: Behind) -> Result<Photo, DatasetError> {
    Ok(composited(decode(path)?, behind))
}

/// As [`open`], of the content of a file; `path` is for messages.
pub(crate) fn open_bytes(path: &Path, bytes: &[u8], behind: Behind) -> Result<Photo, DatasetError> {
    Ok(composited(decode_bytes(path, bytes)?, behind))
}

/// A photo with the other contents of its file.
pub(crate) struct Opened {
    /// As [`open`] gives it.
    pub photo: Photo,
    /// The file's alpha, 0 to 255, in all three channels; `None` if the file has none or is opaque everywhere.
    pub alpha: Option<Photo>,
    /// See [`deep_range`].
    pub range: Option<[f64; 2]>,
    /// See [`linear::clipped`].
    pub clipped: Option<f64>,
}

/// As [`open`], with the other contents of the file.
pub(crate) fn open_whole(path: &Path, behind: Behind) -> Result<Opened, DatasetError> {
    let image = decode(path)?;
    let (alpha, range) = (alpha(&image).map(Photo::Rgb8), deep_range(&image));
    let clipped = linear::clipped(&image, behind);
    Ok(Opened { photo: composited(image, behind), alpha, range, clipped })
}

/// Share of the pixels left out at either end of a range: hot and dead pixels of a sensor.
const OUTSIDE: f64 = 1e-3;

/// The levels that the pixels of a photo of more than 8 bits have, as shares of its full range; `None` of a photo of 8
/// bits, or in linear light.
pub(crate) fn deep_range(image: &DynamicImage) -> Option<[f64; 2]> {
    if linear::is_light(image) || !has_more_than_bytes(image.color()) {
        return None;
    }
    let mut counts = vec![0u64; 1 << 16];
    let pixels = image.to_rgb16();
    pixels.as_raw().iter().for_each(|level| counts[usize::from(*level)] += 1);
    let left_out = (OUTSIDE * pixels.as_raw().len() as f64) as u64;
    let (low, high) = (first_beyond(counts.iter(), left_out)?, first_beyond(counts.iter().rev(), left_out)?);
    let last = f64::from(u16::MAX);
    Some([low as f64 / last, 1.0 - high as f64 / last])
}

/// The place of the first count with which more than `left_out` have passed.
fn first_beyond<'a>(mut counts: impl Iterator<Item = &'a u64>, left_out: u64) -> Option<usize> {
    let mut passed = 0;
    counts.position(|count| {
        passed += count;
        passed > left_out
    })
}

fn alpha(image: &DynamicImage) -> Option<image::RgbImage> {
    if !image.color().has_alpha() {
        return None;
    }
    let pixels = image.to_luma_alpha8();
    let is_opaque = pixels.pixels().all(|pixel| pixel.0[1] == u8::MAX);
    let level = |x, y| image::Rgb([pixels.get_pixel(x, y).0[1]; 3]);
    (!is_opaque).then(|| image::RgbImage::from_fn(pixels.width(), pixels.height(), level))
}

fn composited(image: DynamicImage, behind: Behind) -> Photo {
    let is_plain = behind.levels.is_none();
    match image {
        DynamicImage::ImageRgb8(image) if is_plain => Photo::Rgb8(image),
        image @ DynamicImage::ImageLuma8(_) if is_plain => Photo::Rgb8(image.into_rgb8()),
        image if linear::is_light(&image) => Photo::Rgb32(linear::displayed(image, behind)),
        image if !image.color().has_alpha() => {
            let mut image = image.into_rgb32f();
            image.iter_mut().for_each(|value| *value = behind.stretch(*value));
            Photo::Rgb32(image)
        }
        image => {
            let rgba = image.into_rgba32f();
            let mut rgb = image::Rgb32FImage::new(rgba.width(), rgba.height());
            for (out, pixel) in rgb.pixels_mut().zip(rgba.pixels()) {
                let [r, g, b, alpha] = pixel.0;
                let [r, g, b] = [r, g, b].map(|value| behind.stretch(value));
                out.0 = [behind.mix(r, 0, alpha), behind.mix(g, 1, alpha), behind.mix(b, 2, alpha)];
            }
            Photo::Rgb32(rgb)
        }
    }
}
