//! The compressed PLY of PlayCanvas: chunks of 256 Gaussians with the range of their values, and per Gaussian four
//! words of 32 bits.
//!
//! Element `chunk`: `min_` and `max_` of x, y, z, of the logarithms `scale_x`, `scale_y`, `scale_z`, and in newer files
//! of r, g, b. Element `vertex`: `packed_position` and `packed_scale` (11, 10, 11 bits between the chunk's ends),
//! `packed_rotation` (2 bits for the largest component of w x y z, 10 bits for each other), `packed_color` (8 bits
//! each: red, green, blue, opacity). An element `sh` has bytes `f_rest_*`, -4 to 4.

use std::f64::consts::SQRT_2;
use std::io::{self, Read};

use gs_base::FileError;
use gs_base::npy::Number;
use gs_base::ply::{Element, Encoding, Header};

use super::source::{Records, Source, cut, missing, too_many};
use super::{REST_KEPT, REST_PER_CHANNEL};
use crate::COUNT_MAX;
use crate::splats::{ALPHA_LEAST, SH_C0};

/// Gaussians in a chunk.
const CHUNK: usize = 256;

const RANGES: [&str; 6] = ["x", "y", "z", "scale_x", "scale_y", "scale_z"];
const COLOURS: [&str; 3] = ["r", "g", "b"];
const WORDS: [&str; 4] = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];

/// Whether a header is that of a compressed file.
pub(super) fn is_compressed(header: &Header) -> bool {
    let element = |name: &str| header.elements.iter().find(|element| element.name == name);
    element("chunk").is_some()
        && element("vertex").is_some_and(|vertex| vertex.properties.iter().any(|p| p.name == WORDS[0]))
}

/// The Gaussians, and the coefficients per channel above degree 0 in the file.
pub(super) fn read(mut source: Source) -> Result<(Records, usize), FileError> {
    if source.header.encoding == Encoding::Ascii {
        return Err(FileError::malformed(&source.path, "header", "a compressed PLY file in binary", "text"));
    }
    let (count, rest) = (counted(&source)?, rest_per_channel(&source)?);
    let (mut chunks, mut words, mut harmonics) = (Table::default(), Table::default(), Table::default());
    for element in source.header.elements.clone() {
        let (names, table) = match element.name.as_str() {
            "chunk" => (range_names(&element), &mut chunks),
            "vertex" => (WORDS.map(str::to_owned).to_vec(), &mut words),
            "sh" => ((0..3 * rest).map(|k| format!("f_rest_{k}")).collect(), &mut harmonics),
            _ => (Vec::new(), &mut Table::default()),
        };
        *table = Table::read(&mut source, &element, &names)?;
    }
    let mut records = Records::with_capacity(&source.path, count, rest.min(REST_KEPT))?;
    let (mut record, mut broken) = (Vec::new(), None::<(usize, usize)>);
    for index in 0..count {
        record.clear();
        unpack(chunks.row(index / CHUNK), words.row(index), &mut record);
        let harmonic = |k: usize| harmonic(harmonics.row(index)[k]);
        record
            .extend((0..rest.min(REST_KEPT)).flat_map(|k| (0..3).map(move |channel| channel * rest + k)).map(harmonic));
        if record.iter().all(|value| (*value as f32).is_finite()) {
            records.push(&record);
        } else {
            broken.get_or_insert((index, 0)).1 += 1;
        }
    }
    match broken {
        None => Ok((records, rest)),
        Some((vertex, broken)) => {
            Ok((records.without(&source.path, vertex, "a range of its chunk", "not finite", (broken, count))?, rest))
        }
    }
}

/// How many Gaussians there are, if the file is long enough for all that its header promises.
fn counted(source: &Source) -> Result<usize, FileError> {
    let Source { path, header, file_len, .. } = source;
    let wrong = |expected: String, found: &str| FileError::malformed(path, "header", expected, found);
    let count_of = |name: &str| header.elements.iter().find(|e| e.name == name).map_or(0, |element| element.count);
    let count = count_of("vertex");
    if count > COUNT_MAX as u64 {
        return Err(too_many(path, count));
    }
    let mut expected = header.len as u64;
    for element in &header.elements {
        let stride = element.stride().ok_or_else(|| wrong("no lists in a compressed PLY file".into(), "one"))?;
        expected = expected.saturating_add(element.count.saturating_mul(stride as u64));
    }
    if expected > *file_len {
        return Err(cut(path, count, expected, *file_len));
    }
    let chunks = count.div_ceil(CHUNK as u64);
    let is_right = count_of("chunk") == chunks && [0, count].contains(&count_of("sh"));
    if !is_right {
        let expected = format!("{chunks} chunks of {CHUNK} and harmonics of each Gaussian for {count} of them");
        return Err(wrong(expected, "others"));
    }
    Ok(count as usize)
}

fn rest_per_channel(source: &Source) -> Result<usize, FileError> {
    let Some(element) = source.header.elements.iter().find(|element| element.name == "sh") else { return Ok(0) };
    let found = element.properties.len();
    let rest = REST_PER_CHANNEL.into_iter().find(|rest| 3 * rest == found);
    let expected = "0, 9, 24, 45 or 72 properties in element `sh`";
    rest.ok_or_else(|| FileError::malformed(&source.path, "header", expected, found.to_string()))
}

/// Least values, largest values; those of colours where the chunk has them.
fn range_names(element: &Element) -> Vec<String> {
    let has_colours = element.properties.iter().any(|property| property.name == "min_r");
    let ranges = RANGES.iter().chain(if has_colours { &COLOURS[..] } else { &[] });
    ranges.flat_map(|name| [format!("min_{name}"), format!("max_{name}")]).collect()
}

/// Some columns of an element, row by row.
#[derive(Default)]
struct Table {
    values: Vec<f64>,
    columns: usize,
}

impl Table {
    /// Reads an element to its end, and keeps the columns `names`.
    fn read(source: &mut Source, element: &Element, names: &[String]) -> Result<Self, FileError> {
        let path = source.path.clone();
        let io = |error| FileError::read(&path, error);
        let stride = element.stride().unwrap_or_default();
        let column = |name: &String| element.column(name).ok_or_else(|| missing(&path, name));
        let columns = names.iter().map(column).collect::<Result<Vec<_>, _>>()?;
        let mut table = Self { values: Vec::new(), columns: columns.len() };
        let room = table.values.try_reserve_exact(element.count as usize * columns.len());
        room.map_err(|error| io(io::Error::other(error)))?;
        let mut record = vec![0; stride];
        if columns.is_empty() {
            // Jumped over and not read: they may be terabytes.
            source.file.seek_relative((element.count * stride as u64) as i64).map_err(io)?;
            return Ok(table);
        }
        for _ in 0..element.count {
            source.file.read_exact(&mut record).map_err(io)?;
            let value = |(_, offset, scalar): &(usize, usize, Number)| scalar.read(&record[*offset..]);
            table.values.extend(columns.iter().map(value));
        }
        Ok(table)
    }

    fn row(&self, index: usize) -> &[f64] {
        &self.values[index * self.columns..][..self.columns]
    }
}

/// The packed record of a Gaussian without its harmonics above degree 0.
fn unpack(ranges: &[f64], words: &[f64], record: &mut Vec<f64>) {
    let between = |range: usize, share: f64| ranges[2 * range] * (1.0 - share) + ranges[2 * range + 1] * share;
    let [position, rotation, scale, colour] = [0, 1, 2, 3].map(|i| words[i] as u32);
    let mean = three(position);
    record.extend([0, 1, 2].map(|a| between(a, mean[a])));
    record.extend(quaternion(rotation));
    let scale = three(scale);
    record.extend([0, 1, 2].map(|a| between(3 + a, scale[a])));
    let [red, green, blue, opacity] = [24, 16, 8, 0].map(|shift| f64::from(colour >> shift & 255) / 255.0);
    let opacity = opacity.clamp(ALPHA_LEAST, 1.0 - ALPHA_LEAST);
    record.push((opacity / (1.0 - opacity)).ln());
    let colours = [red, green, blue];
    let has_ranges = ranges.len() > 2 * RANGES.len();
    let of_range = |a: usize| if has_ranges { between(RANGES.len() + a, colours[a]) } else { colours[a] };
    record.extend([0, 1, 2].map(|a| (of_range(a) - 0.5) / SH_C0));
}

/// 11, 10 and 11 bits, each 0 to 1.
fn three(word: u32) -> [f64; 3] {
    [f64::from(word >> 21) / 2047.0, f64::from(word >> 11 & 1023) / 1023.0, f64::from(word & 2047) / 2047.0]
}

/// w x y z: the largest component follows from the other three, which are within 1 / sqrt 2.
fn quaternion(word: u32) -> [f64; 4] {
    let others = [20, 10, 0].map(|shift| (f64::from(word >> shift & 1023) / 1023.0 - 0.5) * SQRT_2);
    let largest = (1.0 - others.iter().map(|x| x * x).sum::<f64>()).max(0.0).sqrt();
    let mut rest = others.into_iter();
    let which = (word >> 30) as usize;
    std::array::from_fn(|i| if i == which { largest } else { rest.next().unwrap_or_default() })
}

fn harmonic(byte: f64) -> f64 {
    let share = match byte {
        0.0 => 0.0,
        255.0 => 1.0,
        _ => (byte + 0.5) / 256.0,
    };
    (share - 0.5) * 8.0
}
