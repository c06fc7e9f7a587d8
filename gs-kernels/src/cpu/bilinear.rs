//! An image between its pixels: bilinear lookups of all channels at once, forward and backward.
//!
//! A lookup reads the four pixels of a patch, named by its first pixel. In the backward pass the lookups are ordered by
//! the row of their patch, so that each row of the image's gradient has one writer and one order of additions.

use rayon::prelude::*;

use crate::cpu::Real;
use crate::cpu::segments::SegmentLists;

/// Lookups per task; a task is about 20 microseconds.
const BLOCK: usize = 1 << 11;

/// Where one position lies along one axis.
#[derive(Clone, Copy)]
struct Axis<F> {
    first: usize,
    next: usize,
    /// 0 at the first pixel's centre, 1 at the next one's.
    fraction: F,
    /// Whether the position is between the outermost centres, so that it changes the result.
    inside: bool,
}

impl<F: Real> Axis<F> {
    fn at(position: F, pixels: usize) -> Self {
        let last = pixels - 1;
        let from_first = position - F::of(0.5);
        let inside = !(from_first < F::ZERO || from_first > F::of(last as f64));
        let held = from_first.greatest(F::ZERO).least(F::of(last as f64));
        // NaN looks at pixel 0; the fraction carries it.
        let first = (held.floor_i32().max(0) as usize).min(last.saturating_sub(1));
        let fraction =
            if from_first.partial_cmp(&F::ZERO).is_some() { held - F::of_i32(first as i32) } else { from_first };
        Self { first, next: (first + 1).min(last), fraction, inside }
    }
}

/// The four pixels of a lookup and its place among them.
struct Patch<F> {
    pixels: [usize; 4],
    x: Axis<F>,
    y: Axis<F>,
}

impl<F: Real> Patch<F> {
    fn at(position: &[F], [height, width]: [usize; 2]) -> Self {
        let (x, y) = (Axis::at(position[0], width), Axis::at(position[1], height));
        let pixels = [(x.first, y.first), (x.next, y.first), (x.first, y.next), (x.next, y.next)];
        Self { pixels: pixels.map(|(x, y)| y * width + x), x, y }
    }

    /// Shares of the four pixels.
    fn shares(&self) -> [F; 4] {
        let (right, below) = (self.x.fraction, self.y.fraction);
        let (left, above) = (F::ONE - right, F::ONE - below);
        [left * above, right * above, left * below, right * below]
    }
}

/// Values of `image` `[H, W, C]` at `positions` `[P, 2]` (x, y in pixels; the first pixel's centre is (0.5, 0.5)), `[P,
/// C]`. Beyond the outermost centres the image goes on as at its border.
///
/// # Panics
/// When the slices disagree in length or the image has no pixel.
pub fn forward<F: Real>(image: &[F], size: [usize; 2], channels: usize, positions: &[F]) -> Vec<F> {
    check(image, size, channels);
    let mut out = vec![F::ZERO; positions.len() / 2 * channels];
    if channels > 0 {
        let blocks = out.par_chunks_mut(BLOCK * channels).zip(positions.par_chunks(2 * BLOCK));
        blocks.for_each(|(out, positions)| {
            for (out, position) in out.chunks_exact_mut(channels).zip(positions.chunks_exact(2)) {
                let patch = Patch::at(position, size);
                let (shares, pixels) = (patch.shares(), patch.pixels.map(|pixel| pixel * channels));
                for (c, out) in out.iter_mut().enumerate() {
                    let [a, b, c, d] = pixels.map(|pixel| image[pixel + c]);
                    *out = a * shares[0] + b * shares[1] + c * shares[2] + d * shares[3];
                }
            }
        });
    }
    out
}

/// The gradient by the positions, `[P, 2]`, from `v` `[P, C]`: the slope of the patch, zero beyond the border.
///
/// # Panics
/// As [`forward`].
pub fn by_positions<F: Real>(image: &[F], size: [usize; 2], channels: usize, positions: &[F], v: &[F]) -> Vec<F> {
    check(image, size, channels);
    assert_eq!(v.len(), positions.len() / 2 * channels, "a value for each lookup and channel");
    let mut out = vec![F::ZERO; positions.len()];
    if channels > 0 {
        let blocks = out.par_chunks_mut(2 * BLOCK).zip(positions.par_chunks(2 * BLOCK));
        blocks.zip(v.par_chunks(BLOCK * channels)).for_each(|((out, positions), v)| {
            let lookups = out.chunks_exact_mut(2).zip(positions.chunks_exact(2)).zip(v.chunks_exact(channels));
            for ((out, position), v) in lookups {
                let patch = Patch::at(position, size);
                let pixels = patch.pixels.map(|pixel| pixel * channels);
                let (right, below) = (patch.x.fraction, patch.y.fraction);
                for (c, v) in v.iter().enumerate() {
                    let [a, b, c, d] = pixels.map(|pixel| image[pixel + c]);
                    out[0] += *v * ((b - a) * (F::ONE - below) + (d - c) * below);
                    out[1] += *v * ((c - a) * (F::ONE - right) + (d - b) * right);
                }
                for (out, axis) in out.iter_mut().zip([&patch.x, &patch.y]) {
                    if !axis.inside {
                        *out = F::ZERO;
                    }
                }
            }
        });
    }
    out
}

/// The gradient by the image, `[H, W, C]`, from `v` `[P, C]`.
///
/// # Panics
/// As [`forward`].
pub fn by_image<F: Real>([height, width]: [usize; 2], channels: usize, positions: &[F], v: &[F]) -> Vec<F> {
    let count = positions.len() / 2;
    assert_eq!(v.len(), count * channels, "a value for each lookup and channel");
    let mut out = vec![F::ZERO; height * width * channels];
    if channels == 0 || out.is_empty() {
        return out;
    }
    let rows: Vec<u32> =
        positions.par_chunks_exact(2).map(|position| Axis::at(position[1], height).first as u32).collect();
    let all = 0..u32::try_from(count).expect("at most 2^32 - 1 lookups");
    let lookups = SegmentLists::new(rows, height, all).expect("a patch begins in a row of the image");
    out.par_chunks_exact_mut(width * channels).enumerate().for_each(|(row, out)| {
        // Patches whose next row this is, then those that begin in it; in an image of one row both are the same patch.
        for first in row.saturating_sub(1)..=row {
            for lookup in lookups.rows_of(first).iter().map(|lookup| *lookup as usize) {
                let patch = Patch::at(&positions[2 * lookup..][..2], [height, width]);
                let v = &v[lookup * channels..][..channels];
                for (pixel, share) in patch.pixels.into_iter().zip(patch.shares()) {
                    if let Some(pixel) = pixel.checked_sub(row * width).filter(|pixel| *pixel < width) {
                        let out = &mut out[pixel * channels..][..channels];
                        out.iter_mut().zip(v).for_each(|(out, v)| *out += share * *v);
                    }
                }
            }
        }
    });
    out
}

fn check<F>(image: &[F], [height, width]: [usize; 2], channels: usize) {
    assert!(height > 0 && width > 0, "an image to sample must have pixels, it has {width} x {height}");
    assert_eq!(image.len(), height * width * channels, "the image must be [{height}, {width}, {channels}]");
}
