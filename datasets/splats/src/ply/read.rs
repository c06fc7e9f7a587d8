//! Reading a scene.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use gs_base::local::localised;
use gs_base::npy::Number;
use gs_base::ply::{Element, Encoding, Header, start_of};
use gs_base::{FileError, printable};

use super::source::{Records, Source, cut, degree, missing, too_many};
use super::{RECORD_OPACITY, REST_KEPT, REST_PER_CHANNEL, SplatRenderMode, compressed, record_names};
use crate::{COUNT_MAX, Splats};

/// A scene and what its file says of it.
#[derive(Debug, Clone)]
pub struct PlyScene {
    /// The Gaussians. Their offset is that of the file's comment, or else the middle of the Gaussians where that is far
    /// from the origin.
    pub splats: Splats,
    /// How they are to be drawn, where the file says so.
    pub render_mode: Option<SplatRenderMode>,
    /// Degree of the harmonics in the file, 0 to 4; above 3 they were left out.
    pub sh_degree: usize,
    /// A sentence about the vertices that were left out, because a value of theirs is not finite.
    pub left_out: Option<String>,
}

/// Reads a scene.
///
/// # Errors
/// When the file cannot be read, is not a PLY file, lacks a property, is cut short, or holds no vertex of finite
/// values.
pub fn read(path: &Path) -> Result<PlyScene, FileError> {
    let source = Source::open(path)?;
    let (render_mode, offset) = (source.render_mode, source.offset);
    let (Records { means, mut splats, left_out }, rest) = if compressed::is_compressed(&source.header) {
        compressed::read(source)?
    } else {
        let reader = Reader::of(source)?;
        let rest = reader.rest;
        (reader.read()?, rest)
    };
    (splats.means, splats.offset) = localised(&means, offset);
    splats.antialiased = render_mode.map(|mode| mode == SplatRenderMode::Mip);
    Ok(PlyScene { splats, render_mode, sh_degree: degree(rest), left_out })
}

/// The logit of an opacity of 1 - 1e-7, the nearest to 1 that a sigmoid in `f32` tells from it.
const OPACITY_MOST: f64 = 16.118;

/// Longest line of a text file, bytes: a vertex of degree 3 has 62 numbers, and a face a few more.
const LINE_MAX: u64 = 1 << 16;

/// The position of a value of the packed record in a vertex.
struct Column {
    name: String,
    /// Index among the properties.
    index: usize,
    /// Bytes before it in a binary vertex.
    offset: usize,
    scalar: Number,
}

/// The first vertex with a value that is none, and how many there are.
struct Broken {
    vertex: usize,
    /// Index in the packed record.
    column: usize,
    found: String,
    count: usize,
}

struct Reader {
    path: PathBuf,
    file: BufReader<File>,
    file_len: u64,
    header: Header,
    /// The first byte of the vertices.
    start: u64,
    /// Index of the element `vertex`.
    vertex: usize,
    /// Coefficients per channel above degree 0 in the file.
    rest: usize,
    columns: Vec<Column>,
}

impl Reader {
    fn of(Source { path, file, file_len, header, .. }: Source) -> Result<Self, FileError> {
        let bad = |expected: &str, found: &str| FileError::malformed(&path, "header", expected, found);
        let vertex = header.elements.iter().position(|element| element.name == "vertex");
        let vertex = vertex.ok_or_else(|| bad("an element `vertex`", "none"))?;
        let element = &header.elements[vertex];
        if let Some(list) = element.properties.iter().find(|property| property.scalar.is_none()) {
            return Err(bad("numbers in element `vertex`", &format!("the list `{}`", start_of(&list.name))));
        }
        let rest = rest_per_channel(element).map_err(|found| bad(REST_EXPECTED, &found))?;
        let columns = columns(&path, element, rest)?;
        Ok(Self { path, file, file_len, start: header.len as u64, header, vertex, rest, columns })
    }

    fn read(mut self) -> Result<Records, FileError> {
        match self.header.encoding {
            Encoding::Ascii => self.read_text(),
            _ => {
                self.skip_binary()?;
                self.read_binary()
            }
        }
    }

    fn element(&self) -> &Element {
        &self.header.elements[self.vertex]
    }

    /// Rejects a file that is shorter than its vertices, before memory is allocated for them.
    fn check_length(&self, before: u64, each: u64) -> Result<usize, FileError> {
        let count = self.element().count;
        let expected = count.saturating_mul(each).saturating_add(before);
        if expected > self.file_len {
            return Err(cut(&self.path, count, expected, self.file_len));
        }
        if count > COUNT_MAX as u64 {
            return Err(too_many(&self.path, count));
        }
        Ok(count as usize)
    }

    fn room(&self, count: usize) -> Result<Records, FileError> {
        Records::with_capacity(&self.path, count, self.rest.min(REST_KEPT))
    }

    /// Bytes of header and of the elements in front of the vertices, which are skipped.
    fn skip_binary(&mut self) -> Result<(), FileError> {
        let mut skipped = 0_u64;
        for element in &self.header.elements[..self.vertex] {
            let stride = element.stride().ok_or_else(|| {
                let found = format!("`{}` with a list before it", start_of(&element.name));
                FileError::malformed(&self.path, "header", "element `vertex` first", found)
            })?;
            skipped = skipped.saturating_add(element.count.saturating_mul(stride as u64));
        }
        let stride = self.element().stride().expect("a vertex without lists");
        self.start = self.start.saturating_add(skipped);
        self.check_length(self.start, stride as u64)?;
        // Jumped over and not read: they may be terabytes. No file is longer than an i64 says.
        self.file.seek_relative(skipped as i64).map_err(|source| self.io(source))?;
        Ok(())
    }

    fn read_binary(&mut self) -> Result<Records, FileError> {
        let stride = self.element().stride().expect("a vertex without lists");
        let count = self.check_length(self.start, stride as u64)?;
        let mut records = self.room(count)?;
        let mut bytes = vec![0; stride];
        let mut record = vec![0.0; self.columns.len()];
        let mut broken = None;
        for vertex in 0..count {
            self.file.read_exact(&mut bytes).map_err(|source| self.io(source))?;
            for (value, column) in record.iter_mut().zip(&self.columns) {
                *value = column.scalar.read(&bytes[column.offset..]);
            }
            self.keep(&mut record, vertex, &mut records, &mut broken);
        }
        self.complete(records, broken)
    }

    fn read_text(&mut self) -> Result<Records, FileError> {
        let properties = self.element().properties.len();
        // Every number takes a digit and a separator; the last line may lack its end.
        let count = self.check_length(self.start.saturating_sub(1), 2 * properties as u64)?;
        let before: u64 =
            self.header.elements[..self.vertex].iter().fold(0, |sum, element| sum.saturating_add(element.count));
        let mut line = String::new();
        for _ in 0..before {
            self.next_line(&mut line)?;
        }
        let mut records = self.room(count)?;
        let mut record = vec![0.0; self.columns.len()];
        let mut broken = None;
        for vertex in 0..count {
            self.next_line(&mut line)?;
            let words: Vec<&str> = line.split_whitespace().collect();
            if words.len() != properties {
                let expected = format!("{properties} numbers on a line");
                return Err(self.wrong(format!("vertex {vertex}"), expected, words.len().to_string()));
            }
            for (value, column) in record.iter_mut().zip(&self.columns) {
                *value = words[column.index].parse().unwrap_or(f64::NAN);
            }
            self.keep(&mut record, vertex, &mut records, &mut broken);
            if let Some(Broken { column, found, .. }) = broken.as_mut().filter(|broken| broken.vertex == vertex) {
                *found = format!("`{}`", printable(&start_of(words[self.columns[*column].index])));
            }
        }
        self.complete(records, broken)
    }

    /// The next line that is not blank.
    fn next_line(&mut self, line: &mut String) -> Result<(), FileError> {
        loop {
            line.clear();
            let length = self.file.by_ref().take(LINE_MAX).read_line(line).map_err(|source| self.io(source))?;
            if length as u64 == LINE_MAX {
                let expected = format!("lines of less than {LINE_MAX} bytes");
                return Err(self.wrong("a vertex".into(), expected, "a longer one".into()));
            }
            if length == 0 {
                let count = self.element().count;
                return Err(cut(&self.path, count, self.file_len + 1, self.file_len));
            }
            if !line.trim().is_empty() {
                return Ok(());
            }
        }
    }

    /// Keeps a record, unless one of its values is none: then it counts, and the first is remembered. An opacity
    /// without end is the one of a Gaussian that is quite opaque or quite clear, which has no other logit.
    fn keep(&self, record: &mut [f64], vertex: usize, records: &mut Records, broken: &mut Option<Broken>) {
        let opacity = &mut record[RECORD_OPACITY];
        if opacity.is_infinite() {
            *opacity = opacity.clamp(-OPACITY_MOST, OPACITY_MOST);
        }
        match record.iter().position(|value| !(*value as f32).is_finite()) {
            None => records.push(record),
            Some(column) => {
                let first = || Broken { vertex, column, found: record[column].to_string(), count: 0 };
                broken.get_or_insert_with(first).count += 1;
            }
        }
    }

    /// The records, with a sentence on those that are broken; an error if all are.
    fn complete(&self, records: Records, broken: Option<Broken>) -> Result<Records, FileError> {
        let Some(Broken { vertex, column, found, count: broken }) = broken else { return Ok(records) };
        let counts = (broken, self.element().count as usize);
        records.without(&self.path, vertex, &self.columns[column].name, &found, counts)
    }

    fn io(&self, source: std::io::Error) -> FileError {
        FileError::read(&self.path, source)
    }

    fn wrong(&self, location: String, expected: String, found: String) -> FileError {
        FileError::malformed(&self.path, location, expected, found)
    }
}

/// Highest degree of spherical harmonics that a scene holds.
const SH_DEGREE_MAX: usize = 3;

/// Highest degree that an error recognises by its number of properties.
const SH_DEGREE_KNOWN: usize = 10;

/// The numbers of properties above degree 0 that [`REST_PER_CHANNEL`] means.
const REST_EXPECTED: &str = "0, 9, 24, 45 or 72 properties `f_rest_*`";

/// How many coefficients per channel above degree 0 there are, or a number that is of no degree.
fn rest_per_channel(element: &Element) -> Result<usize, String> {
    let found = element.properties.iter().filter(|property| property.name.starts_with("f_rest_")).count();
    if let Some(rest) = REST_PER_CHANNEL.into_iter().find(|rest| 3 * rest == found) {
        return Ok(rest);
    }
    let higher =
        (REST_PER_CHANNEL.len()..=SH_DEGREE_KNOWN).find(|degree| 3 * ((degree + 1) * (degree + 1) - 1) == found);
    Err(match higher {
        Some(degree) => format!("{found}: SH degree {degree} is not supported (at most {SH_DEGREE_MAX})"),
        None => found.to_string(),
    })
}

fn columns(path: &Path, element: &Element, rest: usize) -> Result<Vec<Column>, FileError> {
    let column = |name: String| match element.column(&name) {
        Some((index, offset, scalar)) => Ok(Column { name, index, offset, scalar }),
        None => Err(missing(path, &name)),
    };
    record_names(rest).into_iter().map(column).collect()
}
