//! A file whose header was read, and the Gaussians that come of it.

use std::collections::TryReserveError;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use gs_base::local::{OFFSET_MAX, is_offset};
use gs_base::ply::{HEADER_MAX, Header, start_of};
use gs_base::{FileError, guarded};

use super::{OFFSET, PlyError, RECORD_LOG_SCALES, RECORD_MEANS, RECORD_OPACITY, RECORD_QUATS, RECORD_SH};
use super::{RENDER_MODE, SplatRenderMode};

/// A file whose header was read.
pub struct Source {
    pub path: PathBuf,
    pub file: BufReader<File>,
    pub file_len: u64,
    pub header: Header,
    /// The word of a comment on drawing; `None` without it, or where it says a word that is not known.
    pub render_mode: Option<SplatRenderMode>,
    /// The vector of a comment that is added to every position; zero without it.
    pub offset: [f64; 3],
}

impl Source {
    pub fn open(path: &Path) -> Result<Self, PlyError> {
        // A file of any length: its vertices are read one by one, and their count is held against the length.
        let mut file = guarded::open_regular(path, u64::MAX)?;
        let io = |error| FileError::read(path, error);
        let file_len = file.metadata().map_err(io)?.len();
        let mut start = Vec::new();
        file.by_ref().take(HEADER_MAX as u64).read_to_end(&mut start).map_err(io)?;
        let header = Header::parse(path, &start)?;
        file.seek(SeekFrom::Start(header.len as u64)).map_err(io)?;
        let (render_mode, offset) = comments(path, &header)?;
        let file = BufReader::with_capacity(1 << 20, file);
        Ok(Self { path: path.to_owned(), file, file_len, header, render_mode, offset })
    }
}

/// The render mode and the offset that the comments say.
fn comments(path: &Path, header: &Header) -> Result<(Option<SplatRenderMode>, [f64; 3]), FileError> {
    let (mut render_mode, mut offset) = (None, [0.0; 3]);
    for comment in &header.comments {
        match comment.split_whitespace().collect::<Vec<_>>()[..] {
            [RENDER_MODE, word] => render_mode = SplatRenderMode::of_word(word),
            [OFFSET, ref words @ ..] => {
                let expected = format!("three numbers up to {OFFSET_MAX:e} as offset");
                offset = offset_of(words)
                    .ok_or_else(|| FileError::malformed(path, "a comment", expected, start_of(comment)))?;
            }
            _ => {}
        }
    }
    Ok((render_mode, offset))
}

fn offset_of(words: &[&str]) -> Option<[f64; 3]> {
    let numbers: Option<Vec<f64>> = words.iter().map(|word| word.parse().ok()).collect();
    numbers.and_then(|numbers| numbers.try_into().ok()).filter(|offset| is_offset(*offset))
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
