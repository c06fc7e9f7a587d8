//! Depth and the other maps, from whichever file holds them.

use std::path::Path;

use gs_base::{guarded, npy};
use image::DynamicImage;

use crate::error::DatasetError;
use crate::exr_file;
use crate::frame::DepthSpace;
use crate::map::Map;
use crate::mask;
use crate::options::DepthKind;
use crate::pixels;
use crate::side_files::DepthMeaning;

/// From here on a depth is a renderer's word for "nothing there" (Blender and Infinigen write 1e10 for the sky), and
/// one such value would decide any fit of scale and shift.
pub(crate) const SKY: f32 = 1e9;

/// A depth file's numbers and what they mean.
pub(super) struct Depth {
    pub map: Map<f32>,
    pub space: DepthSpace,
    pub metric: bool,
    /// The data set does not say what the numbers mean; the kind of file decided.
    pub guessed: bool,
}

/// The formats, told from the first bytes because extensions are often wrong.
enum Content {
    Numpy(npy::Array),
    Exr(Vec<u8>),
    Picture(DynamicImage),
}

fn open(path: &Path) -> Result<Content, DatasetError> {
    let bytes = guarded::read(path, guarded::IMAGE_MAX)?;
    if bytes.starts_with(npy::MAGIC) {
        Ok(Content::Numpy(npy::parse(path, &bytes)?))
    } else if bytes.starts_with(exr_file::MAGIC) {
        Ok(Content::Exr(bytes))
    } else {
        pixels::decode(path).map(Content::Picture)
    }
}

/// Opens a depth file. Unknown pixels are 0 in the map: what is not finite, sky, and in metric depth what is not in
/// front of the camera.
///
/// Where the data set does not say what the numbers mean, an 8-bit picture is taken for inverse depth, since that is
/// what single-image networks save as a picture, and everything else for depth; both up to scale and shift.
pub(super) fn depth(path: &Path, meaning: DepthMeaning) -> Result<Depth, DatasetError> {
    let mut is_8_bit = false;
    let mut is_integer = false;
    let mut map = match open(path)? {
        Content::Numpy(array) => raster(path, array, 1)?,
        Content::Exr(bytes) => exr_file::parse(path, &bytes, exr_file::DEPTH)?,
        Content::Picture(picture) => {
            is_integer = true;
            is_8_bit = picture.color().bytes_per_pixel() == picture.color().channel_count();
            first_channel(path, picture)?
        }
    };
    let guess = if is_8_bit { DepthKind::InverseDepth } else { DepthKind::Depth };
    let kind = meaning.kind.unwrap_or(guess);
    // 256 levels over an unstated range are in no unit.
    let metric = kind == DepthKind::MetricZ && !is_8_bit;
    let step = if metric && is_integer { meaning.step as f32 } else { 1.0 };
    for value in &mut map.values {
        let scaled = *value * step;
        let known = scaled.is_finite() && scaled.abs() < SKY && (scaled > 0.0 || !metric);
        *value = if known { scaled } else { 0.0 };
    }
    let space = if kind == DepthKind::InverseDepth { DepthSpace::InverseDepth } else { DepthSpace::Depth };
    Ok(Depth { map, space, metric, guessed: meaning.kind.is_none() })
}

/// An array as a map of one channel or of three.
fn raster(path: &Path, array: npy::Array, channels: usize) -> Result<Map<f32>, DatasetError> {
    let expected = if channels == 1 { "(H, W), (1, H, W) or (H, W, 1)" } else { "(H, W, 3)" };
    let shape = format!("{:?}", array.shape);
    Map::of_array(array, channels).ok_or_else(|| DatasetError::malformed(path, "shape", expected, shape))
}

/// A depth file as it is, at its own resolution.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthMap {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// `[height, width]`, 0 where unknown.
    pub values: Vec<f32>,
    /// The space in which the numbers are depth up to a scale and a shift.
    pub space: DepthSpace,
}

/// Reads a depth file of any kind that priors may have. Without a `kind`, an 8-bit picture is inverse depth and any
/// other file depth.
///
/// # Errors
/// When it cannot be read, or holds no depth.
pub fn read_depth(path: &Path, kind: Option<DepthKind>) -> Result<DepthMap, DatasetError> {
    let Depth { map, space, .. } = depth(path, DepthMeaning { kind, step: 1.0 })?;
    Ok(DepthMap { width: map.width, height: map.height, values: map.values, space })
}

/// Opens a map of confidences; at least 1, where the file knows nothing.
pub(super) fn confidence(path: &Path) -> Result<Map<f32>, DatasetError> {
    let mut map = depth(path, DepthMeaning { kind: Some(DepthKind::Depth), step: 1.0 })?.map;
    map.values.iter_mut().for_each(|value| *value = value.max(1.0));
    Ok(map)
}

/// Opens a map of vectors: EXR channels X, Y, Z (or R, G, B), or an array `(H, W, 3)`. What is not finite becomes 0.
pub(super) fn vectors(path: &Path) -> Result<Map<f32>, DatasetError> {
    let mut map = match open(path)? {
        Content::Numpy(array) => raster(path, array, 3)?,
        Content::Exr(bytes) => exr_file::parse(path, &bytes, exr_file::VECTOR)?,
        Content::Picture(_) => {
            let found = "a picture".to_string();
            return Err(DatasetError::malformed(path, "velocity", "an OpenEXR file or a NumPy array", found));
        }
    };
    map.values.iter_mut().filter(|value| !value.is_finite()).for_each(|value| *value = 0.0);
    Ok(map)
}

/// Opens a mask: 255 where the file is not 0 (an object's number, white, or any colour), 0 elsewhere.
pub(super) fn objects(path: &Path) -> Result<Map<u8>, DatasetError> {
    let binary = |map: Map<f32>| Map {
        width: map.width,
        height: map.height,
        channels: 1,
        values: map.values.into_iter().map(|value| if value != 0.0 && !value.is_nan() { 255 } else { 0 }).collect(),
    };
    match open(path)? {
        Content::Numpy(array) => raster(path, array, 1).map(binary),
        Content::Exr(bytes) => exr_file::parse(path, &bytes, exr_file::DEPTH).map(binary),
        Content::Picture(picture) => {
            let (width, height) = (picture.width() as usize, picture.height() as usize);
            let threshold = mask::threshold(path);
            let white = |level| if level >= threshold { 255 } else { 0 };
            let values = mask::levels(picture).into_iter().map(white).collect();
            Map::new(width, height, 1, values)
                .ok_or_else(|| DatasetError::malformed(path, "size", "at least one pixel", "none"))
        }
    }
}

/// The first channel's numbers as they are. Pictures of depth in false colours are refused: their channels say nothing.
fn first_channel(path: &Path, picture: DynamicImage) -> Result<Map<f32>, DatasetError> {
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    // Grey levels become equal channels, which nothing rounds.
    let values: Vec<f32> = match picture.color().bytes_per_pixel() / picture.color().channel_count() {
        1 => picture.into_rgb8().into_raw().into_iter().map(f32::from).collect(),
        2 => picture.into_rgb16().into_raw().into_iter().map(f32::from).collect(),
        _ => Vec::new(),
    };
    let (pixels, _) = values.as_chunks::<3>();
    let is_grey = pixels.iter().all(|[r, g, b]| r == g && g == b);
    let map = Map::new(width, height, 1, pixels.iter().map(|[level, ..]| *level).collect()).filter(|_| is_grey);
    map.ok_or_else(|| DatasetError::malformed(path, "colours", "grey levels of depth", "a picture in false colours"))
}
