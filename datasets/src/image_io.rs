//! Writing images: atomically, so that a reader never meets half a file.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec, Vec2, WritableImage,
};
use gs_base::{FileError, write_atomic};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};

/// Writes an 8-bit PNG atomically. `data` is `[height, width, channels]` with 1 (grey), 3 (RGB) or 4 (RGBA) channels,
/// told from its length. Parent folders are made.
///
/// # Errors
/// When `data` fits none of these shapes or the file cannot be written; then `path` is as it was before.
pub fn write_png(path: &Path, width: usize, height: usize, data: &[u8]) -> Result<(), FileError> {
    write_atomic(path, &encode_png(path, width, height, data)?)
}

/// The bytes of [`write_png`]; `path` is for errors.
///
/// # Errors
/// When `data` fits none of the shapes.
pub fn encode_png(path: &Path, width: usize, height: usize, data: &[u8]) -> Result<Vec<u8>, FileError> {
    let pixels = width.saturating_mul(height);
    let color = match data.len() {
        _ if pixels == 0 => None,
        n if n == pixels => Some(ExtendedColorType::L8),
        n if n == pixels.saturating_mul(3) => Some(ExtendedColorType::Rgb8),
        n if n == pixels.saturating_mul(4) => Some(ExtendedColorType::Rgba8),
        _ => None,
    };
    let (Some(color), Ok(w), Ok(h)) = (color, u32::try_from(width), u32::try_from(height)) else {
        return Err(wrong_shape(path, width, height, data.len()));
    };
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(data, w, h, color)
        .map_err(|error| FileError::write(path, std::io::Error::other(error)))?;
    Ok(bytes)
}

/// Writes an OpenEXR file of 32-bit float channels atomically. Each channel is a name ("R", "G", "B", "Z", "A") and
/// `[height, width]` values. Parent folders are made.
///
/// # Errors
/// When a channel has not `width * height` values or the file cannot be written; then `path` is as it was before.
pub fn write_exr(path: &Path, width: usize, height: usize, channels: &[(&str, &[f32])]) -> Result<(), FileError> {
    write_atomic(path, &encode_exr(path, (width, height), channels, None)?)
}

/// The bytes of [`write_exr`], with the name of the program that made them; `path` is for errors.
///
/// # Errors
/// When a channel has not as many values as there are pixels.
pub fn encode_exr(
    path: &Path,
    (width, height): (usize, usize),
    channels: &[(&str, &[f32])],
    software: Option<&str>,
) -> Result<Vec<u8>, FileError> {
    let pixels = width.saturating_mul(height);
    let mut list: SmallVec<[AnyChannel<FlatSamples>; 4]> = SmallVec::new();
    for (name, values) in channels {
        if values.len() != pixels || pixels == 0 {
            return Err(wrong_shape(path, width, height, values.len()));
        }
        let name = exr::prelude::Text::new_or_none(name)
            .ok_or_else(|| FileError::malformed(path, "channel", "a name in ASCII", format!("{name:?}")))?;
        list.push(AnyChannel::new(name, FlatSamples::F32(values.to_vec())));
    }
    if list.is_empty() {
        return Err(wrong_shape(path, width, height, 0));
    }
    let software_name = software.and_then(exr::prelude::Text::new_or_none);
    let attributes = LayerAttributes { software_name, ..LayerAttributes::default() };
    let layer = Layer::new(Vec2(width, height), attributes, Encoding::SMALL_LOSSLESS, AnyChannels::sort(list));
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .to_buffered(&mut bytes)
        .map_err(|error| FileError::write(path, std::io::Error::other(error)))?;
    Ok(bytes.into_inner())
}

fn wrong_shape(path: &Path, width: usize, height: usize, found: usize) -> FileError {
    FileError::malformed(
        path,
        "image to write",
        format!("{width} x {height} pixels of whole channels"),
        format!("{found} values"),
    )
}
