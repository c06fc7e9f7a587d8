//! `.splat`, the format of the first viewers in browsers: 32 bytes a Gaussian, no header and no harmonics. It is read,
//! not written.
//!
//! | bytes | contents |
//! |---|---|
//! | 12 | position, `f32` |
//! | 12 | standard deviations, `f32` |
//! | 4 | colour and opacity, shares of 255 |
//! | 4 | rotation w x y z, `(byte - 128) / 128` |

use std::path::Path;

use gs_base::{FileError, guarded};

use crate::splats::{ALPHA_LEAST, SH_C0, logit};
use crate::{COUNT_MAX, FILE_MAX, Splats};

/// Bytes of a Gaussian.
const ROW: usize = 32;

/// The least standard deviation that is read, scene units: zero has no logarithm.
const SCALE_LEAST: f32 = 1e-10;

/// Reads a `.splat` file; values may be not finite.
///
/// # Errors
/// When the file cannot be read, or is no whole number of Gaussians.
pub fn read(path: &Path) -> Result<Splats, FileError> {
    decode(&guarded::read(path, FILE_MAX)?).map_err(|message| FileError::wrong(path, message))
}

/// [`read`] of bytes.
///
/// # Errors
/// A sentence without the file's name.
pub fn decode(file: &[u8]) -> Result<Splats, String> {
    let (count, rest) = (file.len() / ROW, file.len() % ROW);
    if rest != 0 || count > COUNT_MAX {
        return Err(format!(
            "expected at most {COUNT_MAX} Gaussians of {ROW} bytes, found {} bytes; the file is cut short or another",
            file.len()
        ));
    }
    let mut splats = Splats::default();
    for row in file.chunks_exact(ROW) {
        let number = |at: usize| f32::from_le_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]]);
        splats.means.push([number(0), number(4), number(8)]);
        splats.log_scales.push([number(12), number(16), number(20)].map(log_scale));
        push_color(&mut splats, [row[24], row[25], row[26], row[27]]);
        splats.quats.push([row[28], row[29], row[30], row[31]].map(|byte| (f32::from(byte) - 128.0) / 128.0));
    }
    Ok(splats)
}

/// The logarithm of a standard deviation.
pub(crate) fn log_scale(scale: f32) -> f32 {
    scale.max(SCALE_LEAST).ln()
}

/// Adds a colour and an opacity in bytes.
pub(crate) fn push_color(splats: &mut Splats, [red, green, blue, alpha]: [u8; 4]) {
    splats.sh.push([red, green, blue].map(|byte| (f32::from(byte) / 255.0 - 0.5) / SH_C0 as f32));
    splats.opacity_logits.push(logit(f64::from(alpha) / 255.0, ALPHA_LEAST));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_read_as_it_is_laid_out() {
        let mut row = Vec::new();
        [1.0_f32, -2.0, 3.0, 0.1, 0.2, 0.0].iter().for_each(|x| row.extend(x.to_le_bytes()));
        row.extend([255, 0, 51, 204, 255, 128, 64, 128]);
        let splats = decode(&row).expect("one Gaussian");
        assert_eq!(splats.means, [[1.0, -2.0, 3.0]]);
        assert_eq!(splats.log_scales, [[0.1_f32.ln(), 0.2_f32.ln(), 1e-10_f32.ln()]]);
        assert_eq!(splats.quats, [[127.0 / 128.0, 0.0, -0.5, 0.0]]);
        assert_eq!(splats.sh, [[0.5, -0.5, -0.3].map(|x: f32| x / SH_C0 as f32)]);
        assert!((splats.opacity_logits[0] - 4.0_f32.ln()).abs() < 1e-5);
        splats.check().expect("finite");
        assert!(decode(&row[1..]).is_err());
        assert!(decode(&[]).expect("none").is_empty());
    }
}
