//! Version 1: a file of records (TFRecord), each a frame as a message of Protocol Buffers.
//!
//! Field numbers are those of the data set's `dataset.proto` and `label.proto`.
//!
//! | file | holds |
//! |---|---|
//! | `crc.rs` | checksums of records |
//! | `wire.rs` | fields of a message |
//! | `describe.rs` | records, poses, calibrations and frames |
//! | `read.rs` | range images, images and boxes |

mod crc;
mod describe;
mod read;
mod wire;

use std::fmt;
use std::path::{Path, PathBuf};

/// Longest file, bytes. A segment has about 1 GB.
const FILE_MAX: u64 = 64 << 30;

/// Longest record, bytes. A frame has some 5 MB.
const RECORD_MAX: u64 = 256 << 20;

/// The place of a record's content in the file.
#[derive(Debug, Clone, Copy)]
struct Record {
    start: u64,
    length: usize,
}

impl fmt::Display for Record {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the record of {} bytes from {} on", self.length, self.start)
    }
}

/// A file of records, by the times of their frames.
#[derive(Debug)]
pub(crate) struct Records {
    path: PathBuf,
    records: Vec<Record>,
}

impl Records {
    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }
}
