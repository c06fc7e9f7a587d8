//! [`DatasetError`]: a mistake of a data set in one sentence, with the file, the expected and the found.

use std::fmt;
use std::path::{Path, PathBuf};

use gs_base::sentence::shown;
use gs_base::{FileError, printable};

/// Any failure to read or write a data set. Its text is one sentence that names the file, what was expected there and
/// what was found instead; underlying errors are part of the text, so nothing is lost by printing only `Display`. Names
/// in it are [`printable`](gs_base::printable()).
#[derive(Debug)]
#[non_exhaustive]
pub enum DatasetError {
    /// A file could not be read or written, or its content breaks the rules of its format.
    File(FileError),

    /// The folder or file is none of the formats this crate reads.
    UnknownFormat {
        /// The path given to `load`.
        path: PathBuf,
        /// The layouts that would have been accepted.
        expected: String,
        /// The content of that path.
        found: String,
    },

    /// A camera pose is not a rotation and a translation.
    Pose {
        /// The file with the pose.
        path: PathBuf,
        /// The frame's name as the file writes it.
        frame: String,
        /// The rule of a pose.
        expected: String,
        /// The fault of this one.
        found: String,
    },

    /// An image's proportions contradict the size its intrinsics were made for, so they cannot be rescaled to it.
    SizeMismatch {
        /// The image.
        path: PathBuf,
        /// The file with the declared size.
        declared_in: PathBuf,
        /// Width and height the intrinsics belong to.
        declared: (f64, f64),
        /// Width and height of the image.
        actual: (u32, u32),
        /// A likely cause, or empty.
        hint: &'static str,
    },

    /// An image could not be decoded.
    Image {
        /// The image.
        path: PathBuf,
        /// The decoder's complaint.
        found: String,
    },

    /// A mask does not lie over its photo.
    MaskShape {
        /// The mask.
        path: PathBuf,
        /// Width and height of its photo.
        photo: (usize, usize),
        /// Width and height of the mask.
        found: (usize, usize),
    },

    /// A valid file asks for something this crate does not do.
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The feature it asks for.
        what: String,
        /// The features that would be accepted.
        expected: String,
    },

    /// Nothing is left to load.
    NoFrames {
        /// The scene.
        path: PathBuf,
        /// Why there is none.
        found: String,
    },

    /// The split leaves nothing to train on.
    NoTrainingViews {
        /// The scene.
        path: PathBuf,
        /// How the views were split.
        found: String,
    },

    /// A load option has no meaning for this scene.
    Option {
        /// The scene.
        path: PathBuf,
        /// The option's name.
        option: &'static str,
        /// The values it may have.
        expected: String,
        /// The value it has.
        found: String,
    },
}

impl fmt::Display for DatasetError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // No sentence has a control character of its own, so that all of it may be escaped at once.
        f.write_str(&printable(&self.sentence()))
    }
}

impl std::error::Error for DatasetError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::File(error) => error.source(),
            _ => None,
        }
    }
}

impl DatasetError {
    fn sentence(&self) -> String {
        match self {
            Self::File(error) => error.to_string(),
            Self::UnknownFormat { path, expected, found } => {
                format!("{}: expected {expected}, found {found}", shown(path))
            }
            Self::Pose { path, frame, expected, found } => {
                format!("{}: pose of frame {frame:?}: expected {expected}, found {found}", shown(path))
            }
            Self::SizeMismatch { path, declared_in, declared, actual, hint } => format!(
                "{}: expected an image of {} x {} pixels (or the same proportions) as {} declares, found {} x {}{hint}",
                shown(path),
                declared.0,
                declared.1,
                shown(declared_in),
                actual.0,
                actual.1
            ),
            Self::Image { path, found } => {
                format!("{}: expected a readable PNG or JPEG image, found: {found}", shown(path))
            }
            Self::MaskShape { path, photo, found } => format!(
                "{}: expected a mask of the photo's proportions, {} x {} pixels, found {} x {}",
                shown(path),
                photo.0,
                photo.1,
                found.0,
                found.1
            ),
            Self::Unsupported { path, what, expected } => {
                format!("{}: {what} is not supported: expected {expected}", shown(path))
            }
            Self::NoFrames { path, found } => {
                format!("{}: expected at least one frame with an image, found {found}", shown(path))
            }
            Self::NoTrainingViews { path, found } => {
                format!("{}: expected at least one training view, found none: {found}", shown(path))
            }
            Self::Option { path, option, expected, found } => {
                format!("{}: option `{option}`: expected {expected}, found {found}", shown(path))
            }
        }
    }

    /// A failed reading.
    pub fn read(path: &Path, source: std::io::Error) -> Self {
        FileError::read(path, source).into()
    }

    /// Content of a file that breaks the rules of its format, at a `location` in it.
    pub fn malformed(
        path: &Path,
        location: impl Into<String>,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        FileError::malformed(path, location, expected, found).into()
    }
}

impl From<FileError> for DatasetError {
    fn from(error: FileError) -> Self {
        Self::File(error)
    }
}
