//! Fused L1 and SSIM (Wang et al. 2004) of two images, and their gradient.
//!
//! 11 x 11 Gaussian window `w` (sigma 1.5) applied as two passes of 11 taps, zero padding, per channel, mean over
//! pixels and channels. SSIM is symmetric in the images, so it is written in their sum `s = x + y` and difference
//! `d = x - y`: four moments `mu_s`, `mu_d`, `E_ss`, `E_dd` where `x` and `y` have five. With `V_s = E_ss - mu_s^2` and
//! `V_d = E_dd - mu_d^2`: `A1 = 2 mu_x mu_y + C1`, `A2 = (V_s - V_d) / 2 + C2`, `B1 = mu_x^2 + mu_y^2 + C1`,
//! `B2 = (V_s + V_d) / 2 + C2`, `SSIM = A1 A2 / (B1 B2)`. The gradient filters SSIM's derivatives by `mu_x`, `E_xx` and
//! `E_xy` once more: `v_x = w * d_mu + 2 x (w * d_Exx) + y (w * d_Exy)`.
//!
//! Moments are those of `x - 1/2` (outside the image too, where `x` is 0): variances do not change, and the difference
//! `E_ss - mu_s^2` loses up to four times less to rounding.
//!
//! A task is an area so narrow that the last 11 filtered rows of every map stay in the processor's cache: of whole rows
//! of a photo they would not. A row is treated as `W C` numbers whose taps are `C` apart, so interleaved channels need
//! no shuffling. The gradient is computed in the same walk: its maps never reach memory, which costs a fifth more
//! arithmetic for a quarter of the bytes.

mod area;

use rayon::prelude::*;

use crate::constants::PIXEL_MAX;
use crate::cpu::Real;
use crate::cpu::parallel::{Disjoint, zeros};
use crate::cpu::real::{LaneTask, Lanes};
use area::{Area, Images, Task};

/// Rows of an area: fixed, so that sums do not depend on threads; high enough that the rows around it cost a sixth.
const STRIP: usize = 128;
/// Numbers of a row of an area: eleven rows of seven maps take 90 kB of `f32`, and the columns around cost an eighth.
const BLOCK: usize = 256;

/// Result of [`forward`].
#[derive(Clone, Debug)]
pub struct SsimForward<F> {
    /// Mean absolute difference.
    pub l1: F,
    /// Mean structural similarity, -1 to 1; 1 for equal images and for an empty one.
    pub ssim: F,
    /// Gradient of the sum of all pixels' SSIM with respect to `image` `[H, W, C]`; empty if it was not asked for.
    pub gradient: Vec<F>,
}

/// Compares `image` with `target`, both `[H, W, C]`. Values that are not finite or beyond [`PIXEL_MAX`] count as 0.
///
/// # Panics
/// When the slices disagree in length.
pub fn forward<F: Real>(
    image: &[F],
    target: &[F],
    width: usize,
    height: usize,
    channels: usize,
    with_gradient: bool,
) -> SsimForward<F> {
    let len = width * height * channels;
    assert!(image.len() == len && target.len() == len, "image and target must be [{height}, {width}, {channels}]");
    if len == 0 {
        return SsimForward { l1: F::ZERO, ssim: F::ONE, gradient: Vec::new() };
    }
    let images = Images { image, target, row: width * channels, height, channels };
    let mut gradient = zeros(if with_gradient { len } else { 0 });
    let shared = with_gradient.then(|| Disjoint::new(&mut gradient));
    let blocks = images.row.div_ceil(BLOCK);
    let tasks = (0..height.div_ceil(STRIP) * blocks).into_par_iter();
    let sums: Vec<[f64; 2]> = tasks
        .map(|task| {
            let part = |size: usize, index: usize, end: usize| index * size..((index + 1) * size).min(end);
            let area =
                Area { rows: part(STRIP, task / blocks, height), columns: part(BLOCK, task % blocks, images.row) };
            let gradient = shared.as_ref();
            match channels {
                1 => F::with_lanes(Task::<F, 1> { images, area, gradient }),
                3 => F::with_lanes(Task::<F, 3> { images, area, gradient }),
                _ => F::with_lanes(Task::<F, 0> { images, area, gradient }),
            }
        })
        .collect();
    let [l1, ssim] = sums.iter().fold([0.0, 0.0], |sum, s| [sum[0] + s[0], sum[1] + s[1]]);
    SsimForward { l1: F::of(l1 / len as f64), ssim: F::of(ssim / len as f64), gradient }
}

/// Turns the gradient of [`forward`] for the same images into the one with respect to `image` `[H, W, C]`, from the
/// gradients with respect to the two means.
///
/// SSIM and L1 are symmetric: for the gradient with respect to `target`, call both with the images swapped.
///
/// # Panics
/// When the slices disagree in length.
pub fn backward<F: Real>(image: &[F], target: &[F], gradient: &mut [F], v_l1: F, v_ssim: F) {
    /// Numbers per task.
    const PART: usize = 1 << 16;
    let len = gradient.len();
    assert!(image.len() == len && target.len() == len, "image, target and gradient differ in length");
    let scale = F::of(1.0 / len.max(1) as f64);
    let finite = |v: F| if v.is_finite() { v * scale } else { F::ZERO };
    let v = [finite(v_l1), finite(v_ssim)];
    let images = image.par_chunks(PART).zip(target.par_chunks(PART));
    images.zip(gradient.par_chunks_mut(PART)).for_each(|((image, target), gradient)| {
        F::with_lanes(Scaled { image, target, gradient, v });
    });
}

/// Numbers of [`backward`].
struct Scaled<'a, F> {
    image: &'a [F],
    target: &'a [F],
    gradient: &'a mut [F],
    /// Gradients by the sums of L1 and SSIM.
    v: [F; 2],
}

impl<F: Real> LaneTask<F> for Scaled<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Real = F>>(self) {
        let [v_l1, v_ssim] = self.v;
        for ((gradient, &x), &y) in self.gradient.iter_mut().zip(self.image).zip(self.target) {
            let difference = clean(x) - clean(y);
            let positive = if difference > F::ZERO { v_l1 } else { F::ZERO };
            let negative = if difference < F::ZERO { v_l1 } else { F::ZERO };
            let v = v_ssim * *gradient + (positive - negative);
            *gradient = if x.abs() <= F::of(PIXEL_MAX) { v } else { F::ZERO };
        }
    }
}

/// A pixel as the loss reads it.
#[inline(always)]
fn clean<F: Real>(x: F) -> F {
    if x.abs() <= F::of(PIXEL_MAX) { x } else { F::ZERO }
}
