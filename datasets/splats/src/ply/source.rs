//! A file whose header was read, and the Gaussians that come of it.

use std::collections::TryReserveError;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use gs_base::local::{OFFSET_MAX, is_offset};
use gs_base::ply::{HEADER_MAX, Header, start_of};
use gs_base::{FileError, guarded};

use super::{OFFSET, RECORD_LOG_SCALES, RECORD_MEANS, RECORD_OPACITY, RECORD_QUATS, RECORD_SH};
use super::{RENDER_MODE, SplatRenderMode};
use crate::{COUNT_MAX, Splats};

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
    pub fn open(path: &Path) -> Result<Self, FileError> {
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

/// Gaussians as they are read.
#[derive(Default)]
pub struct Records {
    /// As they are in the file: of doubles and of text every digit.
    pub means: Vec<[f64; 3]>,
    /// All but the means.
    pub splats: Splats,
    /// A sentence about vertices that were left out.
    pub left_out: Option<String>,
}

impl Records {
    /// With room for `count` Gaussians with `rest` coefficients per channel above degree 0, if the machine has it.
    pub fn with_capacity(path: &Path, count: usize, rest: usize) -> Result<Self, FileError> {
        fn room<T>(count: usize) -> Result<Vec<T>, TryReserveError> {
            let mut values = Vec::new();
            values.try_reserve_exact(count)?;
            Ok(values)
        }
        let records = || -> Result<Self, TryReserveError> {
            let splats = Splats {
                quats: room(count)?,
                log_scales: room(count)?,
                opacity_logits: room(count)?,
                sh: room((rest + 1) * count)?,
                degree: degree(rest),
                ..Splats::default()
            };
            Ok(Self { means: room(count)?, splats, left_out: None })
        };
        records().map_err(|error| FileError::read(path, io::Error::other(error)))
    }

    /// With a sentence on `broken` of `count` vertices, which were left out; the first has a `property` of no number.
    ///
    /// # Errors
    /// If no vertex is left.
    pub fn without(
        self,
        path: &Path,
        vertex: usize,
        property: &str,
        found: &str,
        (broken, count): (usize, usize),
    ) -> Result<Self, FileError> {
        if self.means.is_empty() {
            let found = format!("{found}; all {count} vertices have such values");
            let expected = format!("a finite number for `{property}`");
            return Err(FileError::malformed(path, format!("vertex {vertex}"), expected, found));
        }
        let left_out = format!(
            "{broken} of {count} vertices were left out, because a value is not finite: `{property}` of vertex \
             {vertex} is {found}"
        );
        Ok(Self { left_out: Some(left_out), ..self })
    }

    /// Adds a packed record of finite numbers.
    pub fn push(&mut self, record: &[f64]) {
        fn floats<const N: usize>(values: &[f64]) -> [f32; N] {
            std::array::from_fn(|index| values[index] as f32)
        }
        self.means.push(std::array::from_fn(|axis| record[RECORD_MEANS][axis]));
        self.splats.quats.push(floats(&record[RECORD_QUATS]));
        self.splats.log_scales.push(floats(&record[RECORD_LOG_SCALES]));
        self.splats.opacity_logits.push(record[RECORD_OPACITY] as f32);
        self.splats.sh.extend(record[RECORD_SH..].chunks_exact(3).map(floats::<3>));
    }
}

/// The degree of harmonics with `rest` coefficients above degree 0.
pub fn degree(rest: usize) -> usize {
    (rest + 1).isqrt() - 1
}

/// More Gaussians than any machine holds.
pub fn too_many(path: &Path, count: u64) -> FileError {
    FileError::malformed(path, "header", format!("at most {COUNT_MAX} vertices"), count.to_string())
}

/// A file that ends before its last vertex.
pub fn cut(path: &Path, count: u64, expected: u64, found: u64) -> FileError {
    let expected = format!("at least {expected} bytes for {count} vertices");
    FileError::malformed(path, "length", expected, format!("{found}; the file is cut short"))
}

/// A property that every Gaussian has and the file has not.
pub fn missing(path: &Path, name: &str) -> FileError {
    let expected = format!("vertex property `{name}` of a Gaussian splatting scene");
    FileError::malformed(path, "header", expected, "none")
}
