//! Pixels at a cut-off: where rounding, not the formula, decides whether a Gaussian counts.
//!
//! Blending has three thresholds ([`gs_kernels::constants`]). Next to one, an error of 1e-7 in a position changes the
//! pixel by up to a whole contribution, so such pixels tell nothing about accuracy. They are found here from the `f64`
//! scene alone, counted, and left out of comparisons, which then excuse nothing else.

use gs_kernels::constants::{ALPHA_MAX, ALPHA_MIN, TRANSMITTANCE_MIN};
use gs_kernels::rows::{PROJECTED, ProjectedRow};

/// Relative distance from a threshold within which a pixel is undecided. In `f32` the exponent of alpha is off by the
/// position's rounding (4e-6 pixels) times its slope (up to 6 a pixel), which is 2e-5; four times that for margin.
const ALPHA_BAND: f64 = 1e-4;
/// The same for the transmittance before anything is blended; each Gaussian adds its alpha's band as `1 - alpha` feels
/// it.
const TRANSMITTANCE_BAND: f64 = 1e-5;

/// Largest share of a scene's pixels that may be undecided: more would hide an error.
pub const SHARE: f64 = 0.01;
/// The same for a stack of hundreds of nearly equal Gaussians, whose pixels each come near many thresholds.
pub const SHARE_IN_STACKS: f64 = 0.05;

/// Whether each pixel of a `width` x `height` image is undecided, row by row, for Gaussians with the given `[N, 8]`
/// rows and opacities.
///
/// # Panics
/// When more than a `share` of the pixels is, and more than one pixel.
#[track_caller]
pub fn undecided_pixels(rows: &[f64], opacities: &[f64], [width, height]: [usize; 2], share: f64) -> Vec<bool> {
    let mut drawn: Vec<_> = rows
        .chunks(PROJECTED)
        .zip(opacities)
        .map(|(row, opacity)| (ProjectedRow::read(row, 0), *opacity))
        .filter(|(row, opacity)| row.radius > 0.0 && *opacity >= ALPHA_MIN)
        .collect();
    drawn.sort_by(|(a, _), (b, _)| a.depth.total_cmp(&b.depth));
    let near = |value: f64, threshold: f64, band: f64| (value / threshold - 1.0).abs() < band;
    let undecided = |pixel: usize| {
        let [x, y] = [pixel % width, pixel / width].map(|k| k as f64 + 0.5);
        let (mut transmittance, mut band) = (1.0, TRANSMITTANCE_BAND);
        for (row, opacity) in &drawn {
            let [d1, l, d2] = row.conic;
            let (dx, dy) = (x - row.mean[0], y - row.mean[1]);
            let raw = opacity * (-0.5 * (d1 * (dx + l * dy).powi(2) + d2 * dy * dy)).exp();
            if near(raw, ALPHA_MIN, ALPHA_BAND) || near(raw, ALPHA_MAX, ALPHA_BAND) {
                return true;
            }
            if raw < ALPHA_MIN {
                continue;
            }
            let next = transmittance * (1.0 - raw.min(ALPHA_MAX));
            if raw < ALPHA_MAX {
                band += ALPHA_BAND * raw / (1.0 - raw);
            }
            if near(next, TRANSMITTANCE_MIN, band) {
                return true;
            }
            if next < TRANSMITTANCE_MIN {
                break;
            }
            transmittance = next;
        }
        false
    };
    let pixels: Vec<bool> = (0..width * height).map(undecided).collect();
    let count = pixels.iter().filter(|p| **p).count();
    let most = 1.0_f64.max(share * pixels.len() as f64);
    assert!(count as f64 <= most, "{count} of {} pixels lie at a cut-off", pixels.len());
    pixels
}

/// `values` of an image with its channels last, 0 in the pixels marked.
pub fn without(values: &[f64], marked: &[bool]) -> Vec<f64> {
    let channels = values.len() / marked.len().max(1);
    values.iter().enumerate().map(|(i, x)| if marked[i / channels] { 0.0 } else { *x }).collect()
}
