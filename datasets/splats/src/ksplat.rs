//! `.ksplat`, the format of the viewer GaussianSplats3D, version 0.1, which is no longer kept up: read, not written.
//!
//! A header of 4096 bytes, headers of 1024 bytes for each section, then the sections. A section has the sizes of its
//! buckets that are not full, the buckets' centres, and its Gaussians. At level 0 all numbers are `f32`; at level 1
//! positions are steps from the centre of their bucket and the others are half floats; at level 2 harmonics are bytes.

use std::path::Path;

use gs_base::{FileError, guarded};
use half::f16;

use crate::bounded::Bytes;
use crate::splat::{log_scale, push_color};
use crate::{COUNT_MAX, FILE_MAX, Splats};

/// Bytes of the header, and of a section's.
const HEADERS: [usize; 2] = [4096, 1024];

/// Steps from the centre of a bucket to its side, where a section does not say.
const STEPS: u32 = 32767;

/// Range of harmonics in bytes, where a file does not say.
const HARMONICS: f32 = 1.5;

/// Reads a `.ksplat` file; values may be not finite.
///
/// # Errors
/// When the file cannot be read, is of another version, or is cut short.
pub fn read(path: &Path) -> Result<Splats, FileError> {
    decode(&guarded::read(path, FILE_MAX)?).map_err(|message| FileError::wrong(path, message))
}

/// [`read`] of bytes.
///
/// # Errors
/// A sentence without the file's name.
pub fn decode(file: &[u8]) -> Result<Splats, String> {
    let mut rest = Bytes(file);
    let header = rest.take(HEADERS[0])?;
    let (major, minor, level) = (header[0], header[1], short(header, 20));
    if major != 0 || minor == 0 || level > 2 {
        return Err(format!(
            "expected a .ksplat file of version 0.1 and level 0 to 2, found version {major}.{minor} and level {level}"
        ));
    }
    let sections = word(header, 4) as usize;
    if sections > file.len() / HEADERS[1] {
        return Err(format!("expected {sections} sections; the file is cut short"));
    }
    let known = |at: usize, otherwise: f32| match number(header, at) {
        value if value.is_finite() && value != 0.0 => value,
        _ => otherwise,
    };
    let range = [known(36, -HARMONICS), known(40, HARMONICS)];
    let sections = (0..sections).map(|_| Section::parse(rest.take(HEADERS[1])?, level, range));
    let sections = sections.collect::<Result<Vec<_>, String>>()?;
    let count = sections.iter().fold(0_usize, |sum, section| sum.saturating_add(section.count));
    if count > COUNT_MAX {
        return Err(format!("expected at most {COUNT_MAX} Gaussians, found {count}"));
    }
    let degree = sections.iter().filter(|section| section.count > 0).map(|section| section.degree).max().unwrap_or(0);
    let mut splats = Splats { degree, ..Splats::default() };
    for section in &sections {
        section.read(&mut rest, &mut splats)?;
    }
    Ok(splats)
}

fn short(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

fn word(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
}

fn number(bytes: &[u8], at: usize) -> f32 {
    f32::from_bits(word(bytes, at))
}

/// A section by its header.
struct Section {
    /// The level of the file.
    level: u16,
    /// Smallest and largest harmonic of level 2.
    range: [f32; 2],
    count: usize,
    /// Gaussians for which the section has room.
    room: usize,
    /// Gaussians of a full bucket.
    capacity: usize,
    buckets: usize,
    /// Length of a step of a position, and steps from the centre of a bucket to its side.
    step: f32,
    steps: f32,
    /// Bytes of a bucket's centre.
    centre: usize,
    full: usize,
    partial: usize,
    degree: usize,
}

impl Section {
    fn parse(header: &[u8], level: u16, range: [f32; 2]) -> Result<Self, String> {
        let size = |at: usize| word(header, at) as usize;
        let steps = match word(header, 24) {
            0 if level == 0 => 1,
            0 => STEPS,
            steps => steps,
        } as f32;
        let degree = usize::from(short(header, 40));
        if degree > 3 {
            return Err(format!("expected harmonics of degree 0 to 3, found {degree}"));
        }
        Ok(Self {
            level,
            range,
            count: size(0),
            room: size(4).max(size(0)),
            capacity: size(8),
            buckets: size(12),
            step: number(header, 16) / 2.0 / steps,
            steps,
            centre: usize::from(short(header, 20)),
            full: size(32),
            partial: size(36),
            degree,
        })
    }

    /// Bytes of a number, and of a harmonic.
    fn widths(&self) -> [usize; 2] {
        [[4, 4], [2, 2], [2, 1]][usize::from(self.level)]
    }

    /// Adds its Gaussians.
    fn read(&self, rest: &mut Bytes, splats: &mut Splats) -> Result<(), String> {
        let product = |a: usize, b: usize| a.checked_mul(b).ok_or("a section is longer than any file".to_string());
        let sizes: Vec<usize> = rest.take(product(4, self.partial)?)?.chunks(4).map(|b| word(b, 0) as usize).collect();
        let centres = rest.take(product(self.centre, self.buckets)?)?;
        let harmonics = (self.degree + 1).pow(2) - 1;
        let [width, of_harmonic] = self.widths();
        let row = 10 * width + 4 + 3 * harmonics * of_harmonic;
        let rows = rest.take(product(row, self.room)?)?;
        let mut ends = sizes.iter();
        let (mut bucket, mut end) =
            (0, if self.full > 0 { self.capacity } else { *ends.next().unwrap_or(&self.count) });
        for (index, row) in rows.chunks_exact(row).take(self.count).enumerate() {
            while index >= end && bucket < self.buckets {
                bucket += 1;
                end += if bucket < self.full { self.capacity } else { *ends.next().unwrap_or(&self.count) };
            }
            let centre = || -> Result<[f32; 3], String> {
                let centre = centres.get(self.centre * bucket..).filter(|centre| centre.len() >= 12);
                let centre = centre.ok_or_else(|| format!("Gaussian {index}: its bucket {bucket} has no centre"))?;
                Ok([number(centre, 0), number(centre, 4), number(centre, 8)])
            };
            let value = |at: usize| self.value(row, at);
            splats.means.push(match self.level {
                0 => [value(0), value(1), value(2)],
                _ => {
                    let centre = centre()?;
                    std::array::from_fn(|i| (f32::from(short(row, 2 * i)) - self.steps) * self.step + centre[i])
                }
            });
            splats.log_scales.push([value(3), value(4), value(5)].map(log_scale));
            splats.quats.push([value(6), value(7), value(8), value(9)]);
            let color = 10 * width;
            push_color(splats, [row[color], row[color + 1], row[color + 2], row[color + 3]]);
            let own = self.harmonics(&row[color + 4..], harmonics);
            splats.sh.extend(own.into_iter().chain(std::iter::repeat([0.0; 3])).take(splats.coefficients() - 1));
        }
        Ok(())
    }

    /// The number `at` of a row.
    fn value(&self, row: &[u8], at: usize) -> f32 {
        match self.level {
            0 => number(row, 4 * at),
            _ => f16::from_bits(short(row, 2 * at)).to_f32(),
        }
    }

    /// The harmonics above degree 0, which are stored degree by degree, and in each channel by channel.
    fn harmonics(&self, bytes: &[u8], count: usize) -> Vec<[f32; 3]> {
        let [low, high] = self.range;
        let value = |at: usize| match self.level {
            0 => number(bytes, 4 * at),
            1 => f16::from_bits(short(bytes, 2 * at)).to_f32(),
            _ => low + f32::from(bytes[at]) / 255.0 * (high - low),
        };
        let mut harmonics = Vec::with_capacity(count);
        for degree in 1..=self.degree {
            let (before, of_degree) = (3 * (degree * degree - 1), 2 * degree + 1);
            harmonics.extend((0..of_degree).map(|i| [0, 1, 2].map(|c| value(before + c * of_degree + i))));
        }
        harmonics
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One section of two Gaussians of degree 1: one in a full bucket, one in another.
    fn file(level: u16) -> Vec<u8> {
        let mut file = vec![0; 4096 + 1024];
        let mut put = |at: usize, bytes: &[u8]| file[at..at + bytes.len()].copy_from_slice(bytes);
        put(1, &[1]);
        put(4, &1_u32.to_le_bytes());
        put(20, &level.to_le_bytes());
        for (at, value) in [(0, 2_u32), (4, 2), (8, 1), (12, 2), (24, 100), (32, 1), (36, 1)] {
            put(4096 + at, &value.to_le_bytes());
        }
        put(4096 + 16, &4.0_f32.to_le_bytes());
        put(4096 + 20, &12_u16.to_le_bytes());
        put(4096 + 40, &1_u16.to_le_bytes());
        file.extend(1_u32.to_le_bytes());
        [0.0_f32, 0.0, 0.0, 10.0, 20.0, 30.0].iter().for_each(|x| file.extend(x.to_le_bytes()));
        for gaussian in 0..2 {
            let add = |file: &mut Vec<u8>, value: f32| match level {
                0 => file.extend(value.to_le_bytes()),
                _ => file.extend(f16::from_f32(value).to_le_bytes()),
            };
            for position in [1.0_f32, -1.0, 0.5] {
                // Two units of a bucket's half side are a hundred steps.
                match level {
                    0 => add(&mut file, position + gaussian as f32 * 10.0),
                    _ => file.extend(((position * 50.0 + 100.0) as u16).to_le_bytes()),
                }
            }
            [0.5, 0.25, 0.125, 1.0, 0.0, 0.0, 0.0].iter().for_each(|x| add(&mut file, *x));
            file.extend([255, 128, 0, 255]);
            for harmonic in 0..9 {
                match level {
                    2 => file.push([0, 255, 51][harmonic % 3]),
                    _ => add(&mut file, harmonic as f32 * 0.125),
                }
            }
        }
        file
    }

    #[test]
    fn all_levels_are_read() {
        for level in 0..=2 {
            let splats = decode(&file(level)).expect("two Gaussians");
            splats.check().expect("finite");
            let second = if level == 0 { [11.0, 9.0, 10.5] } else { [11.0, 19.0, 30.5] };
            assert_eq!(splats.means, [[1.0, -1.0, 0.5], second], "level {level}");
            assert_eq!(splats.log_scales[1], [0.5_f32.ln(), 0.25_f32.ln(), 0.125_f32.ln()]);
            assert_eq!((splats.quats[0], splats.degree), ([1.0, 0.0, 0.0, 0.0], 1));
            // Channel by channel: the first harmonic has the values 0, 3 and 6 of the file.
            let first = if level == 2 { [-1.5; 3] } else { [0.0, 0.375, 0.75] };
            assert_eq!(splats.sh[1], first, "level {level}");
        }
    }

    #[test]
    fn what_is_cut_short_or_another_is_refused() {
        let whole = file(1);
        for length in [0, 100, 4096, 5000, 5121, whole.len() - 1] {
            assert!(decode(&whole[..length]).is_err(), "{length} bytes");
        }
        let changed = |at: usize, bytes: &[u8]| {
            let mut file = whole.clone();
            file[at..at + bytes.len()].copy_from_slice(bytes);
            decode(&file)
        };
        assert!(changed(0, &[1]).is_err(), "another version");
        assert!(changed(20, &[3]).is_err(), "another level");
        assert!(changed(4, &[255; 4]).is_err(), "many sections");
        assert!(changed(4096, &[255; 4]).is_err(), "many Gaussians");
        assert!(changed(4096 + 12, &[255; 4]).is_err(), "many buckets");
        assert!(changed(4096 + 40, &[9]).is_err(), "a degree");
    }
}
