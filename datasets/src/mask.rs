//! Mask files: which pixels of a photo count.

use std::path::{Path, PathBuf};

use image::{DynamicImage, ImageFormat};

use crate::error::DatasetError;
use crate::pixels;

/// Below this a pixel of a lossy file counts as black: JPEG rings around edges, so "not black" cannot mean "not 0".
const JPEG_BLACK: u8 = 128;

/// When masks take more than this share of the median view, their polarity is probably the other one.
pub(crate) const SUSPECT_SHARE: f64 = 0.6;

/// The meaning of white (any pixel that is not black) in a mask file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum White {
    Keep,
    Ignore,
}

/// A mask file that exists or is at least named by the data set.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MaskFile {
    pub path: PathBuf,
    pub white: White,
}

/// The pixels of a photo that count, at a size of its own; lookups scale to the nearest pixel.
pub(crate) struct Mask {
    width: usize,
    height: usize,
    keep: Vec<bool>,
}

impl Mask {
    /// Reads a mask of any PNG or JPEG kind: grey, palette (the shown colour counts), 1 bit, colour.
    pub fn open(file: &MaskFile, photo_size: (usize, usize)) -> Result<Self, DatasetError> {
        let image = pixels::decode(&file.path)?;
        let (width, height) = (image.width() as usize, image.height() as usize);
        let ratio = width as f64 * photo_size.1 as f64 / (height as f64 * photo_size.0 as f64);
        if (ratio - 1.0).abs() > 0.01 {
            let found = (width, height);
            return Err(DatasetError::MaskShape { path: file.path.clone(), photo: photo_size, found });
        }
        let threshold = threshold(&file.path);
        let keep_white = file.white == White::Keep;
        let keep = levels(image).into_iter().map(|level| (level >= threshold) == keep_white).collect();
        Ok(Self { width, height, keep })
    }

    /// Whether the photo's position (u, v) counts; `size` is the photo's.
    pub fn keeps(&self, u: f64, v: f64, size: (usize, usize)) -> bool {
        let x = ((u * self.width as f64 / size.0 as f64) as usize).min(self.width.saturating_sub(1));
        let y = ((v * self.height as f64 / size.1 as f64) as usize).min(self.height.saturating_sub(1));
        self.keep.get(y * self.width + x).copied().unwrap_or(true)
    }
}

/// The lowest level that is not black in a mask file of this name.
pub(crate) fn threshold(path: &Path) -> u8 {
    let lossy = ImageFormat::from_path(path).is_ok_and(|format| format == ImageFormat::Jpeg);
    if lossy { JPEG_BLACK } else { 1 }
}

/// The share of a photo that its masks ignore, on a grid that is fine enough for [`suspicion`].
pub(crate) fn ignored_share(masks: &[Mask], size: (usize, usize)) -> f64 {
    const GRID: usize = 64;
    let mut ignored = 0;
    for i in 0..GRID * GRID {
        let u = ((i % GRID) as f64 + 0.5) / GRID as f64 * size.0 as f64;
        let v = ((i / GRID) as f64 + 0.5) / GRID as f64 * size.1 as f64;
        ignored += usize::from(!masks.iter().all(|mask| mask.keeps(u, v, size)));
    }
    ignored as f64 / (GRID * GRID) as f64
}

/// The brightest colour channel of each pixel. Alpha does not count: masks saved as RGBA are opaque everywhere.
pub(crate) fn levels(image: DynamicImage) -> Vec<u8> {
    match image {
        DynamicImage::ImageLuma8(image) => image.into_raw(),
        // 16-bit values are brought to 8 bits rounding up, so that an id of 1 does not become black.
        other => other
            .into_rgb16()
            .pixels()
            .map(|pixel| pixel.0.iter().copied().max().unwrap_or(0).div_ceil(257) as u8)
            .collect(),
    }
}
