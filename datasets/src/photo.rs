//! Single photos and maps for readers of other kinds of logs: [`read_photo`], [`decode_photo`], [`photo_size`],
//! [`read_exr`].

use std::path::Path;

use gs_base::guarded;

use crate::behind::Behind;
use crate::error::DatasetError;
use crate::exr_file;
use crate::frame::RgbImage8;
use crate::map::Map;
use crate::pixels;
use crate::resample::resample;
use crate::resize::target_size;
use crate::undistort::Undistortion;

/// Decodes a PNG or JPEG file and downscales it by area to `max_width` pixels where it is wider. Transparent pixels are
/// composited on black.
///
/// # Errors
/// When the file is missing, cut short, no PNG or JPEG, or larger than memory for one photo may be.
pub fn read_photo(path: &Path, max_width: Option<usize>) -> Result<RgbImage8, DatasetError> {
    let photo = pixels::open(path, Behind::BLACK)?;
    let (width, height) = target_size(photo.size(), max_width);
    let (data, ..) = resample(photo, &[], None, (width, height));
    Ok(RgbImage8 { width, height, data })
}

/// As [`read_photo`], of the content of a photo in a larger file, `path`, which messages name. With an `undistortion`
/// the lens distortion is removed before the image is downscaled.
///
/// # Errors
/// As [`read_photo`], and when the photo has another size than the undistortion.
pub fn decode_photo(
    path: &Path,
    bytes: &[u8],
    max_width: Option<usize>,
    undistortion: Option<&Undistortion>,
) -> Result<RgbImage8, DatasetError> {
    let photo = pixels::open_bytes(path, bytes, Behind::BLACK)?;
    let size = photo.size();
    if let Some(expected) = undistortion.map(Undistortion::size).filter(|expected| *expected != size) {
        let expected = format!("{} x {} pixels, as the calibration says", expected.0, expected.1);
        return Err(DatasetError::malformed(path, "an image", expected, format!("{} x {}", size.0, size.1)));
    }
    let (width, height) = target_size(size, max_width);
    let (data, ..) = resample(photo, &[], undistortion, (width, height));
    Ok(RgbImage8 { width, height, data })
}

/// The width and height to which an image of `size` pixels is downscaled with `max_width`.
pub fn downscaled_size(size: (usize, usize), max_width: Option<usize>) -> (usize, usize) {
    target_size(size, max_width)
}

/// Width and height that [`read_photo`] gives, pixels, from the header of the file; and its full width and height.
///
/// # Errors
/// When the file is missing or its header cannot be read.
pub fn photo_size(path: &Path, max_width: Option<usize>) -> Result<[(usize, usize); 2], DatasetError> {
    let (width, height) = pixels::size_of(path)?;
    let full = (width as usize, height as usize);
    Ok([target_size(full, max_width), full])
}

/// Channels of an OpenEXR file.
#[derive(Debug, Clone, PartialEq)]
pub struct ExrChannels {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `[height, width, channels]`, in the order in which the channels were asked for.
    pub values: Vec<f32>,
}

/// Reads channels of an OpenEXR file by their names, without regard to case and to the names of layers before the last
/// dot.
///
/// # Errors
/// When the file is missing or broken, asks for more memory than its length can fill, or lacks a channel.
pub fn read_exr(path: &Path, channels: &[&str]) -> Result<ExrChannels, DatasetError> {
    let bytes = guarded::read(path, guarded::IMAGE_MAX)?;
    let Map { width, height, values, .. } = exr_file::parse(path, &bytes, &[channels])?;
    Ok(ExrChannels { width, height, values })
}
