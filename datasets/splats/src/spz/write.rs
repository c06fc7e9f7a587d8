//! Writing version 3.

use std::io::Write;
use std::path::Path;

use flate2::{Compression, GzBuilder};
use gs_base::{FileError, write_atomic};

use super::{ANTIALIASED, COLOUR, FRACTIONAL_BITS, MAGIC, OFFSET, SCALE_LEAST, SCALE_STEPS, rotation};
use crate::splats::{sigmoid, unit};
use crate::turn::flip;
use crate::{MARK, Splats};

/// Most Gaussians that Niantic's own reader takes.
const COUNT_MAX: usize = 10_000_000;

/// Largest position in steps: 24 bits with a sign.
const POSITION_MAX: f64 = 8_388_607.0;

/// Writes a scene as SPZ 3, all of it; [`far`](super::far) names Gaussians that are better left out before.
///
/// # Errors
/// When the file cannot be written, a value is not finite, the scene spans more than 8 million units, or has more than
/// 10 million Gaussians.
pub fn write(path: &Path, splats: &Splats) -> Result<(), FileError> {
    let bytes = encode(splats).map_err(|message| FileError::wrong(path, message))?;
    write_atomic(path, &bytes)
}

/// Bits behind the point of a position: 12, or as many fewer as the farthest Gaussian needs; `None` if it fits with
/// none.
pub fn fractional_bits(splats: &Splats) -> Option<u32> {
    bits_of(largest(splats, None))
}

/// Gaussians that are larger than the largest size of a file, `exp(5.9375)`, and become that large.
pub fn oversized(splats: &Splats) -> usize {
    let most = f32::from(u8::MAX) / SCALE_STEPS + SCALE_LEAST + 0.5 / SCALE_STEPS;
    splats.log_scales.iter().filter(|scales| scales.iter().any(|s| *s > most)).count()
}

/// The largest part of a position, scene units, of all rows but `without`, which rise.
pub(super) fn largest(splats: &Splats, without: Option<&[u32]>) -> f64 {
    let mut without = without.unwrap_or_default().iter().peekable();
    let is_in = |(row, _): &(usize, &[f32; 3])| without.next_if(|next| **next as usize == *row).is_none();
    let parts = splats.means.iter().enumerate().filter(is_in).flat_map(|(_, mean)| mean);
    parts.fold(0.0_f64, |most, x| most.max(f64::from(x.abs())))
}

pub(super) fn bits_of(largest: f64) -> Option<u32> {
    (0..=FRACTIONAL_BITS).rev().find(|bits| (largest * f64::from(1_u32 << bits)).round() <= POSITION_MAX)
}

/// The sentence on positions that no file holds.
fn too_far(splats: &Splats) -> String {
    let reaches = |mean: &[f32; 3]| mean.iter().any(|x| f64::from(x.abs()).round() > POSITION_MAX);
    let row = splats.means.iter().position(reaches).unwrap_or(0);
    let count = splats.means.iter().filter(|mean| reaches(mean)).count();
    let [x, y, z] = splats.means[row];
    format!(
        "Gaussian {row}: expected a position within {POSITION_MAX} scene units for SPZ, found ({x:e}, {y:e}, {z:e}) \
         ({count} of {} are beyond); .ply and .glb hold them",
        splats.len()
    )
}

/// The bytes of [`write()`].
///
/// # Errors
/// A sentence without the file's name.
pub fn encode(splats: &Splats) -> Result<Vec<u8>, String> {
    splats.check()?;
    if splats.len() > COUNT_MAX {
        return Err(format!("expected at most {COUNT_MAX} Gaussians for SPZ, found {}", splats.len()));
    }
    let bits = fractional_bits(splats).ok_or_else(|| too_far(splats))?;
    let splats = flip(splats);
    let antialiased = if splats.antialiased == Some(true) { ANTIALIASED } else { 0 };
    let mut raw: Vec<u8> = Vec::with_capacity(16 + splats.len() * (20 + 3 * (splats.coefficients() - 1)));
    raw.extend(MAGIC.to_le_bytes());
    raw.extend(3_u32.to_le_bytes());
    raw.extend((splats.len() as u32).to_le_bytes());
    raw.extend([splats.degree as u8, bits as u8, antialiased, 0]);
    for x in splats.means.iter().flatten() {
        let steps = (f64::from(*x) * f64::from(1_u32 << bits)).round() as i32;
        raw.extend(&steps.to_le_bytes()[..3]);
    }
    raw.extend(splats.opacity_logits.iter().map(|logit| byte(255.0 * sigmoid(*logit) as f32)));
    let s = splats.coefficients();
    raw.extend(splats.sh.iter().step_by(s).flatten().map(|x| byte(255.0 * (COLOUR * x + 0.5))));
    raw.extend(splats.log_scales.iter().flatten().map(|x| byte(SCALE_STEPS * (x - SCALE_LEAST))));
    for q in &splats.quats {
        let [w, x, y, z] = unit(*q);
        raw.extend(rotation::pack([x, y, z, w]).to_le_bytes());
    }
    for sh in splats.sh.chunks(s) {
        raw.extend(sh.iter().enumerate().skip(1).flat_map(|(i, c)| c.map(|x| harmonic(x, if i < 4 { 8 } else { 16 }))));
    }
    let comment = match splats.offset {
        [0.0, 0.0, 0.0] => MARK.to_owned(),
        [x, y, z] => format!("{MARK}{OFFSET}{x} {y} {z}"),
    };
    let mut gzip = GzBuilder::new().comment(comment).write(Vec::new(), Compression::default());
    gzip.write_all(&raw).and_then(|()| gzip.finish()).map_err(|error| format!("cannot compress: {error}"))
}

fn byte(value: f32) -> u8 {
    value.round().clamp(0.0, 255.0) as u8
}

/// A coefficient in steps of 1/128, then in buckets of `bucket` steps: fewer distinct bytes compress better.
fn harmonic(value: f32, bucket: i32) -> u8 {
    let steps = ((value * 128.0).round() as i32).saturating_add(128);
    (steps.saturating_add(bucket / 2) / bucket * bucket).clamp(0, 255) as u8
}
