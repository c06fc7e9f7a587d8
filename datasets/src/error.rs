//! [`DatasetError`]: a mistake of a data set in one sentence, with the file, the expected and the found.

use std::path::{Path, PathBuf};

/// Any failure to read or write a data set. Its text is one sentence that names the file, what was expected there and
/// what was found instead; underlying errors are part of the text, so nothing is lost by printing only `Display`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// A file or folder could not be opened, read or written.
    #[error("{}: cannot {action}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was being done: "read", "write", ...
        action: &'static str,
        /// The operating system's answer.
        source: std::io::Error,
    },

    /// There is no regular file where one was expected.
    #[error("{}: expected a file, found {found}", path.display())]
    NotAFile {
        /// What was to be read.
        path: PathBuf,
        /// What it is: "a folder", "a device", "a pipe" or "a socket".
        found: &'static str,
    },

    /// A file is longer than any that makes sense in its place.
    #[error("{}: expected a file of at most {limit}, found {found}", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The longest that is read, with its unit.
        limit: String,
        /// Its length, with its unit.
        found: String,
    },

    /// The folder or file is none of the formats this crate reads.
    #[error("{}: expected {expected}, found {found}", path.display())]
    UnknownFormat {
        /// What was given to `load`.
        path: PathBuf,
        /// The layouts that would have been accepted.
        expected: String,
        /// What is there.
        found: String,
    },

    /// A file's content breaks the rules of its format.
    #[error("{}: {location}: expected {expected}, found {found}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where in the file: a line, a byte offset, a key or a frame.
        location: String,
        /// What the format asks for.
        expected: String,
        /// What the file holds.
        found: String,
    },

    /// A camera pose is not a rotation and a translation.
    #[error("{}: pose of frame {frame:?}: expected {expected}, found {found}", path.display())]
    Pose {
        /// The file with the pose.
        path: PathBuf,
        /// The frame's name as the file writes it.
        frame: String,
        /// What a pose must be.
        expected: String,
        /// What this one is.
        found: String,
    },

    /// An image's proportions contradict the size its intrinsics were made for, so they cannot be rescaled to it.
    #[error(
        "{}: expected an image of {} x {} pixels (or the same proportions) as {} declares, found {} x {}{hint}",
        path.display(), declared.0, declared.1, declared_in.display(), actual.0, actual.1
    )]
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
    #[error("{}: expected a readable PNG or JPEG image, found: {found}", path.display())]
    Image {
        /// The image.
        path: PathBuf,
        /// The decoder's complaint.
        found: String,
    },

    /// A mask does not lie over its photo.
    #[error(
        "{}: expected a mask of the photo's proportions, {} x {} pixels, found {} x {}",
        path.display(), photo.0, photo.1, found.0, found.1
    )]
    MaskShape {
        /// The mask.
        path: PathBuf,
        /// Width and height of its photo.
        photo: (usize, usize),
        /// Width and height of the mask.
        found: (usize, usize),
    },

    /// A valid file asks for something this crate does not do.
    #[error("{}: {what} is not supported: expected {expected}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What it asks for.
        what: String,
        /// What would be accepted.
        expected: String,
    },

    /// Nothing is left to load.
    #[error("{}: expected at least one frame with an image, found {found}", path.display())]
    NoFrames {
        /// The scene.
        path: PathBuf,
        /// Why there is none.
        found: String,
    },

    /// The split leaves nothing to train on.
    #[error("{}: expected at least one training view, found none: {found}", path.display())]
    NoTrainingViews {
        /// The scene.
        path: PathBuf,
        /// How the views were split.
        found: String,
    },

    /// A load option has no meaning for this scene.
    #[error("{}: option `{option}`: expected {expected}, found {found}", path.display())]
    Option {
        /// The scene.
        path: PathBuf,
        /// The option's name.
        option: &'static str,
        /// What it may be.
        expected: String,
        /// What it is.
        found: String,
    },
}

impl DatasetError {
    pub(crate) fn read(path: &Path, source: std::io::Error) -> Self {
        Self::Io { path: path.to_path_buf(), action: "read", source }
    }

    pub(crate) fn write(path: &Path, source: std::io::Error) -> Self {
        Self::Io { path: path.to_path_buf(), action: "write", source }
    }

    pub(crate) fn malformed(
        path: &Path,
        location: impl Into<String>,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) -> Self {
        Self::Malformed {
            path: path.to_path_buf(),
            location: location.into(),
            expected: expected.into(),
            found: found.into(),
        }
    }
}
