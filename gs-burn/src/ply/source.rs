//! A file whose header was read, and the Gaussians that come of it.

use std::collections::TryReserveError;
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use super::header::Header;
use super::{PlyError, RECORD_LOG_SCALES, RECORD_MEANS, RECORD_OPACITY, RECORD_QUATS, RECORD_SH};

/// A file whose header was read.
pub struct Source {
    pub path: PathBuf,
    pub file: BufReader<File>,
    pub file_len: u64,
    pub header: Header,
}

impl Source {
    pub fn open(path: &Path) -> Result<Self, PlyError> {
        let io = |source| PlyError::Io { path: path.to_owned(), source };
        // Asked before it is opened: a pipe without a writer would be waited for.
        let metadata = std::fs::metadata(path).map_err(io)?;
        if !metadata.is_file() {
            let found = if metadata.is_dir() { "a folder" } else { "a device or a pipe" };
            return Err(PlyError::NotAFile { path: path.to_owned(), found });
        }
        let file = File::open(path).map_err(io)?;
        let file_len = file.metadata().map_err(io)?.len();
        let mut file = BufReader::with_capacity(1 << 20, file);
        let header = Header::read(path, &mut file)?;
        Ok(Self { path: path.to_owned(), file, file_len, header })
    }
}

/// Gaussians on the host.
#[derive(Default)]
pub struct Records {
    pub means: Vec<f32>,
    pub quats: Vec<f32>,
    pub log_scales: Vec<f32>,
    pub opacity_logits: Vec<f32>,
    pub sh: Vec<f32>,
    /// Coefficients per channel above degree 0 that are kept.
    pub rest: usize,
}

impl Records {
    /// With room for `count` Gaussians, if the machine has it.
    pub fn with_capacity(count: usize, rest: usize) -> Result<Self, TryReserveError> {
        let floats = |each: usize| -> Result<Vec<f32>, TryReserveError> {
            let mut values = Vec::new();
            values.try_reserve_exact(count * each)?;
            Ok(values)
        };
        Ok(Self {
            means: floats(3)?,
            quats: floats(4)?,
            log_scales: floats(3)?,
            opacity_logits: floats(1)?,
            sh: floats(3 * (rest + 1))?,
            rest,
        })
    }

    pub fn push(&mut self, record: &[f32]) {
        self.means.extend_from_slice(&record[RECORD_MEANS]);
        self.quats.extend_from_slice(&record[RECORD_QUATS]);
        self.log_scales.extend_from_slice(&record[RECORD_LOG_SCALES]);
        self.opacity_logits.push(record[RECORD_OPACITY]);
        self.sh.extend_from_slice(&record[RECORD_SH..]);
    }
}
