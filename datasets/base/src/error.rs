//! [`FileError`]: a mistake of a file in one sentence, with the expected and the found.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use crate::sentence::{printable, shown};

/// Any failure to read or write a file. Its text is one sentence that names the file, what was expected there and what
/// was found instead; underlying errors are part of the text. Names in it are [`printable`].
#[derive(Debug)]
pub enum FileError {
    /// A file or folder could not be opened, read or written.
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The verb: "read", "write", ...
        action: &'static str,
        /// The operating system's answer.
        source: io::Error,
    },

    /// There is no regular file where one was expected.
    NotAFile {
        /// The path of the file.
        path: PathBuf,
        /// The kind of thing it is: "a folder", "a device", "a pipe" or "a socket".
        found: &'static str,
    },

    /// A file is longer than any that makes sense in its place.
    TooLarge {
        /// The file.
        path: PathBuf,
        /// The longest that is read, with its unit.
        limit: String,
        /// Its length, with its unit.
        found: String,
    },

    /// A file's content is not what the name of the file says.
    Wrong {
        /// The file.
        path: PathBuf,
        /// The expected and the found.
        message: String,
    },

    /// A file's content breaks the rules of its format.
    Malformed {
        /// The file.
        path: PathBuf,
        /// Where in the file: a line, a byte offset, a key or a frame.
        location: String,
        /// The rule of the format.
        expected: String,
        /// The content of the file there.
        found: String,
    },
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sentence = match self {
            Self::Io { path, action, source } => format!("{}: cannot {action}: {source}", shown(path)),
            Self::NotAFile { path, found } => format!("{}: expected a file, found {found}", shown(path)),
            Self::TooLarge { path, limit, found } => {
                format!("{}: expected a file of at most {limit}, found {found}", shown(path))
            }
            Self::Wrong { path, message } => format!("{}: {message}", shown(path)),
            Self::Malformed { path, location, expected, found } => {
                format!("{}: {location}: expected {expected}, found {found}", shown(path))
            }
        };
        // No sentence has a control character of its own, so that all of it may be escaped at once.
        f.write_str(&printable(&sentence))
    }
}

impl std::error::Error for FileError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Io { source, .. } => Some(source),
            _ => None,
        }
    }
}

impl FileError {
    /// A failed reading.
    pub fn read(path: &Path, source: io::Error) -> Self {
        Self::Io { path: path.to_path_buf(), action: "read", source }
    }

    /// A failed writing.
    pub fn write(path: &Path, source: io::Error) -> Self {
        Self::Io { path: path.to_path_buf(), action: "write", source }
    }

    /// Content that is not what the file's name says, in a sentence without the name.
    pub fn wrong(path: &Path, message: String) -> Self {
        Self::Wrong { path: path.to_path_buf(), message }
    }

    /// Content that breaks the rules of its format.
    pub fn malformed(
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
