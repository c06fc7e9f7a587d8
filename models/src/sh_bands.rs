//! Pruning of view-dependent colour: spherical-harmonic bands are judged by the colour change they can make.
//!
//! Band `l` adds `sum_m b_lm Y_lm(d)` to a channel. Since `sum_m Y_lm(d)^2 = (2 l + 1) / 4 pi` in every direction
//! (addition theorem), it changes the channel by at most `sqrt((2 l + 1) / 4 pi) |b_l|`, and by that much in some
//! direction. As for orders of motion, each band is shrunk as one group by a soft threshold, and the highest bands are
//! removed as long as nobody sees it.

use std::f64::consts::PI;

/// Largest change of a channel that nobody sees: one step of an 8-bit photo.
pub const NOTICEABLE: f64 = 1.0 / 255.0;

/// Largest change of a channel (0 to 1) that band `l` of `sh` can make in any direction. `sh` holds one Gaussian's
/// coefficients `[S, 3]`, row by row.
pub fn change(sh: &[f32], l: usize) -> f64 {
    let squares =
        band(sh, l).chunks_exact(3).fold([0.0; 3], |sum, c| [0, 1, 2].map(|i| sum[i] + f64::from(c[i]).powi(2)));
    (((2 * l + 1) as f64) / (4.0 * PI) * squares.into_iter().fold(0.0, largest)).sqrt()
}

/// The larger of two; NaN if either is.
fn largest(a: f64, b: f64) -> f64 {
    if a.is_nan() || a >= b { a } else { b }
}

/// One proximal step of the group lasso: each band above 0 loses up to `amount` of its largest change.
pub fn shrink(sh: &mut [f32], amount: f64) {
    for l in 1..=room(sh) {
        let change = change(sh, l);
        let factor = if change > amount { 1.0 - amount / change } else { 0.0 };
        band_mut(sh, l).iter_mut().for_each(|x| *x *= factor as f32);
    }
}

/// Zeroes the highest bands as long as all of them together change no channel by more than `limit`, and returns the
/// degree that is left. NaN counts as colour: a degree must not hide it.
pub fn lower(sh: &mut [f32], limit: f64) -> usize {
    let (mut degree, mut changed) = (room(sh), 0.0);
    while degree > 0 {
        changed += change(sh, degree);
        if changed.is_nan() || changed > limit {
            break;
        }
        band_mut(sh, degree).fill(0.0);
        degree -= 1;
    }
    degree
}

/// The degree that `sh` uses: its highest band that is not zero.
pub fn degree(sh: &[f32]) -> usize {
    (1..=room(sh)).rev().find(|l| band(sh, *l).iter().any(|x| *x != 0.0)).unwrap_or(0)
}

/// The degree that `sh` has room for: `S = (degree + 1)^2`.
fn room(sh: &[f32]) -> usize {
    (sh.len() / 3).isqrt() - 1
}

fn band(sh: &[f32], l: usize) -> &[f32] {
    &sh[3 * l * l..3 * (l + 1) * (l + 1)]
}

fn band_mut(sh: &mut [f32], l: usize) -> &mut [f32] {
    &mut sh[3 * l * l..3 * (l + 1) * (l + 1)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Real Y_1m at a direction, to a sign.
    fn first_band(d: [f64; 3]) -> [f64; 3] {
        let c = (3.0 / (4.0 * PI)).sqrt();
        [d[1], d[2], d[0]].map(|x| c * x)
    }

    #[test]
    fn the_change_is_reached_and_not_passed() {
        let mut sh = [0.0_f32; 12];
        sh[3..].copy_from_slice(&[0.3, 0.0, 0.1, -0.2, 0.0, 0.0, 0.6, 0.05, 0.0]);
        let said = change(&sh, 1);
        let mut worst: f64 = 0.0;
        for i in 0..400 {
            // Directions evenly over the sphere (a spiral of the golden angle).
            let z = 1.0 - (2 * i + 1) as f64 / 400.0;
            let (angle, r) = (2.399963 * i as f64, (1.0 - z * z).sqrt());
            let y = first_band([r * angle.cos(), r * angle.sin(), z]);
            worst = (0..3)
                .map(|c| (0..3).map(|m| f64::from(sh[3 + 3 * m + c]) * y[m]).sum::<f64>().abs())
                .fold(worst, f64::max);
        }
        assert!(worst <= said + 1e-9 && worst > 0.99 * said, "{worst} against {said}");
    }

    #[test]
    fn high_bands_fall_first_and_only_if_unseen() {
        let mut sh = [0.0_f32; 27];
        sh[0] = 1.0;
        sh[4] = 1e-4;
        sh[15] = 0.1;
        assert_eq!((degree(&sh), lower(&mut sh.clone(), NOTICEABLE)), (2, 2));
        sh[15] = 1e-4;
        assert_eq!((lower(&mut sh, NOTICEABLE), degree(&sh)), (0, 0));
        assert_eq!(sh[0], 1.0);
        sh[20] = f32::NAN;
        assert_eq!(lower(&mut sh, NOTICEABLE), 2);
        assert_eq!(lower(&mut [0.5, 0.5, 0.5], NOTICEABLE), 0);
    }

    #[test]
    fn a_band_loses_what_was_asked() {
        let mut sh = [0.0_f32; 12];
        sh[3..].copy_from_slice(&[0.3, 0.0, 0.1, -0.2, 0.0, 0.0, 0.6, 0.05, 0.0]);
        let before = change(&sh, 1);
        shrink(&mut sh, 0.01);
        assert!((change(&sh, 1) - (before - 0.01)).abs() < 1e-6);
        shrink(&mut sh, 1.0);
        assert_eq!(degree(&sh), 0);
    }
}
