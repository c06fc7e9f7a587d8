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
    /// As they are in the file: of doubles and of text every digit.
    pub means: Vec<[f64; 3]>,
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
        fn room<T>(count: usize) -> Result<Vec<T>, TryReserveError> {
            let mut values = Vec::new();
            values.try_reserve_exact(count)?;
            Ok(values)
        }
        Ok(Self {
            means: room(count)?,
            quats: room(4 * count)?,
            log_scales: room(3 * count)?,
            opacity_logits: room(count)?,
            sh: room(3 * (rest + 1) * count)?,
            rest,
        })
    }

    /// Adds a packed record of finite numbers.
    pub fn push(&mut self, record: &[f64]) {
        let floats = |range: std::ops::Range<usize>| record[range].iter().map(|x| *x as f32);
        self.means.push(std::array::from_fn(|axis| record[RECORD_MEANS][axis]));
        self.quats.extend(floats(RECORD_QUATS));
        self.log_scales.extend(floats(RECORD_LOG_SCALES));
        self.opacity_logits.push(record[RECORD_OPACITY] as f32);
        self.sh.extend(floats(RECORD_SH..record.len()));
    }
}
