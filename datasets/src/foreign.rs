//! Photos in containers that are not read, and videos: their names, and a sentence that says what to do with them.

use std::path::Path;

use crate::folder::{extension, has_extension, stem};

/// A file that would be a photo, or photos, after a step with another tool.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Foreign {
    /// By the name of its container.
    Photo(&'static str),
    Video,
}

impl Foreign {
    /// Told from the first bytes of a file.
    pub fn of_bytes(bytes: &[u8]) -> Option<Self> {
        let at = |place: usize, word: &[u8]| bytes.get(place..).is_some_and(|rest| rest.starts_with(word));
        let starts: [(&[u8], Self); 6] = [
            (b"GIF8", Self::Photo("GIF")),
            (b"BM", Self::Photo("BMP")),
            (b"\0\0\0\x0cJXL ", Self::Photo("JPEG XL")),
            (&[0xff, 0x0a], Self::Photo("JPEG XL")),
            // Matroska and WebM.
            (&[0x1a, 0x45, 0xdf, 0xa3], Self::Video),
            // MPEG program streams.
            (&[0, 0, 1, 0xba], Self::Video),
        ];
        if at(0, b"RIFF") {
            return at(8, b"AVI ").then_some(Self::Video);
        }
        // The ISO base media file format: its brand says whether it holds an image or a video.
        if at(4, b"ftyp") {
            return Some(match bytes.get(8..12)? {
                b"avif" | b"avis" => Self::Photo("AVIF"),
                b"heic" | b"heix" | b"heim" | b"heis" | b"hevc" | b"hevx" | b"mif1" | b"msf1" => Self::Photo("HEIC"),
                _ => Self::Video,
            });
        }
        starts.into_iter().find(|(start, _)| at(0, start)).map(|(_, kind)| kind)
    }

    /// Told from the extension of a file.
    pub fn of_extension(path: &Path) -> Option<Self> {
        Some(match extension(path).as_str() {
            "heic" | "heif" => Self::Photo("HEIC"),
            "avif" => Self::Photo("AVIF"),
            "gif" => Self::Photo("GIF"),
            "bmp" => Self::Photo("BMP"),
            "jxl" => Self::Photo("JPEG XL"),
            "dng" | "cr2" | "cr3" | "nef" | "arw" => Self::Photo("raw camera"),
            "mp4" | "mov" | "m4v" | "avi" | "mkv" | "webm" | "mpg" | "mpeg" => Self::Video,
            _ => return None,
        })
    }

    /// The kind of file and the next step, for a sentence that names the file.
    pub fn advice(self) -> String {
        match self {
            Self::Photo(name) => format!("a file of the kind {name}; {CONVERT}, and name these in the description"),
            Self::Video => format!("a video; {EXTRACT}, and name these in the description"),
        }
    }
}

/// How to make photos that are read.
pub(crate) const CONVERT: &str =
    "convert the photos to PNG or JPEG first (with ImageMagick: `magick mogrify -format png FILES`)";

/// How to make photos of a video.
pub(crate) const EXTRACT: &str =
    "extract frames of the video first (`ffmpeg -i VIDEO -vf fps=2 -qscale:v 2 images/%05d.jpg`)";

/// How to make poses: with COLMAP's own wheel for Python, or its program.
pub(crate) const POSES: &str = "COLMAP finds the poses of FOLDER/images (`pip install pycolmap`, then `python -c \
    \"import pycolmap as c; d = 'FOLDER/database.db'; i = 'FOLDER/images'; \
    c.extract_features(d, i, camera_mode='SINGLE'); \
    c.match_exhaustive(d); c.incremental_mapping(d, i, 'FOLDER/sparse')\"`; or `colmap automatic_reconstructor \
    --workspace_path FOLDER --image_path FOLDER/images`)";

/// Whether a file is a photo that is read, by its name. Masks beside photos are `NAME.mask.png` and the like.
pub(crate) fn is_photo(path: &Path) -> bool {
    let stem = stem(path);
    let is_mask =
        [".mask", "_mask", "-mask"].iter().any(|end| stem.ends_with(end)) || stem.starts_with("dynamic_mask_");
    !is_mask && has_extension(path, &["png", "jpg", "jpeg", "webp", "tif", "tiff", "exr", "hdr"])
}
