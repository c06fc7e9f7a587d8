//! What can be wrong with a file.

use std::io;
use std::path::PathBuf;

/// Errors of reading and writing scenes for other programs.
#[derive(Debug, thiserror::Error)]
pub enum FormatError {
    /// The file system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's message.
        source: io::Error,
    },
    /// The file is not what its name says, or holds what no scene can.
    #[error("{}: {message}", path.display())]
    Wrong {
        /// The file.
        path: PathBuf,
        /// What was expected and what was found.
        message: String,
    },
}
