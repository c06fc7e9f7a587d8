//! Fused L1 and SSIM (Wang et al. 2004) of two images, forward and backward.
//!
//! 11 x 11 Gaussian window (sigma 1.5) applied as two passes of 11 taps, zero padding, per channel, mean over pixels
//! and channels. With `mu = w * x`, `E_xx = w * x^2`, `E_xy = w * x y`:
//! `A1 = 2 mu_x mu_y + C1`, `A2 = 2 (E_xy - mu_x mu_y) + C2`, `B1 = mu_x^2 + mu_y^2 + C1`,
//! `B2 = (E_xx - mu_x^2) + (E_yy - mu_y^2) + C2`, `SSIM = A1 A2 / (B1 B2)`.
//!
//! The forward keeps the derivatives of SSIM by `mu_x`, `E_xx` and `E_xy`; the backward filters these three maps once:
//! `v_x = w * d_mu + 2 x (w * d_Exx) + y (w * d_Exy)`.
//!
//! Moments are those of `x - 1/2` (outside the image too, where `x` is 0): variances do not change, and the difference
//! `E_xx - mu_x^2` loses up to four times less to rounding.
//!
//! Strips of rows are tasks. Inside a strip, horizontally filtered rows live in a ring of 11, so both passes stay in
//! cache. A row is treated as `W C` numbers whose taps are `C` apart, so interleaved channels need no shuffling.

use rayon::prelude::*;

use crate::constants::{PIXEL_MAX, SSIM_C1, SSIM_C2, SSIM_SHIFT, SSIM_SIGMA, SSIM_WINDOW};
use crate::cpu::Real;
use crate::cpu::parallel::zeros;
use crate::cpu::real::{LANES, LaneTask, Lanes, Number};

/// Rows per task: fixed, so that sums do not depend on threads; high enough that the 10 extra rows cost a sixth.
const STRIP: usize = 64;
/// Rows above and below that a window needs.
const HALO: usize = SSIM_WINDOW / 2;

/// Result of [`forward`].
#[derive(Clone, Debug)]
pub struct SsimForward<F> {
    /// Mean absolute difference.
    pub l1: F,
    /// Mean structural similarity, -1 to 1; 1 for equal images and for an empty one.
    pub ssim: F,
    /// Derivatives of each pixel's SSIM with respect to `mu_x`, `E_xx`, `E_xy`, one map after the other, `[3, H, W,
    /// C]`.
    pub saved: Vec<F>,
}

/// Compares `image` with `target`, both `[H, W, C]`. Values that are not finite or beyond [`PIXEL_MAX`] count as 0.
///
/// # Panics
/// When the slices disagree in length.
pub fn forward<F: Real>(image: &[F], target: &[F], width: usize, height: usize, channels: usize) -> SsimForward<F> {
    let len = width * height * channels;
    assert!(image.len() == len && target.len() == len, "image and target must be [{height}, {width}, {channels}]");
    if len == 0 {
        return SsimForward { l1: F::ZERO, ssim: F::ONE, saved: Vec::new() };
    }
    let mut saved = zeros(3 * len);
    let (d_mu, rest) = saved.split_at_mut(len);
    let (d_xx, d_xy) = rest.split_at_mut(len);
    let size = STRIP * width * channels;
    let sums: Vec<[f64; 2]> = d_mu
        .par_chunks_mut(size)
        .zip(d_xx.par_chunks_mut(size))
        .zip(d_xy.par_chunks_mut(size))
        .enumerate()
        .map(|(strip, ((d_mu, d_xx), d_xy))| {
            let frame = Frame { width, height, channels, first: strip * STRIP };
            F::with_lanes(StripForward { frame, image, target, derivatives: [d_mu, d_xx, d_xy] })
        })
        .collect();
    let [l1, ssim] = sums.iter().fold([0.0, 0.0], |sum, s| [sum[0] + s[0], sum[1] + s[1]]);
    SsimForward { l1: F::of(l1 / len as f64), ssim: F::of(ssim / len as f64), saved }
}

/// Gradient with respect to `image` `[H, W, C]` from the gradients with respect to the two means of [`forward`], whose
/// `saved` maps it needs.
///
/// SSIM and L1 are symmetric: for the gradient with respect to `target`, call both with the images swapped.
///
/// # Panics
/// When the slices disagree in length.
pub fn backward<F: Real>(
    image: &[F],
    target: &[F],
    saved: &[F],
    width: usize,
    height: usize,
    channels: usize,
    v_l1: F,
    v_ssim: F,
) -> Vec<F> {
    let len = width * height * channels;
    assert!(image.len() == len && target.len() == len, "image and target must be [{height}, {width}, {channels}]");
    assert_eq!(saved.len(), 3 * len, "saved must be [3, {height}, {width}, {channels}]");
    let mut v_image = zeros(len);
    let scale = F::of(1.0 / len.max(1) as f64);
    let finite = |v: F| if v.is_finite() { v * scale } else { F::ZERO };
    let v = [finite(v_l1), finite(v_ssim)];
    v_image.par_chunks_mut((STRIP * width * channels).max(1)).enumerate().for_each(|(strip, v_image)| {
        let frame = Frame { width, height, channels, first: strip * STRIP };
        F::with_lanes(StripBackward { frame, image, target, saved, v, v_image });
    });
    v_image
}

/// The position of a strip in the image.
#[derive(Clone, Copy)]
struct Frame {
    width: usize,
    height: usize,
    channels: usize,
    first: usize,
}

impl Frame {
    /// Numbers in a row.
    fn row(&self) -> usize {
        self.width * self.channels
    }
    /// Numbers in a row, rounded up to whole vectors.
    fn padded(&self) -> usize {
        self.row().next_multiple_of(LANES)
    }
    /// Zeros before the row's first number.
    fn lead(&self) -> usize {
        HALO * self.channels
    }
    /// Length of a row with room for every tap of every lane.
    fn spread(&self) -> usize {
        self.padded() + 2 * self.lead()
    }
    /// Output rows of the strip.
    fn rows(&self) -> std::ops::Range<usize> {
        self.first..(self.first + STRIP).min(self.height)
    }
}

/// The window's taps.
fn taps<F: Real>() -> [F; SSIM_WINDOW] {
    let raw: [f64; SSIM_WINDOW] = std::array::from_fn(|i| {
        let d = i as f64 - HALO as f64;
        (-d * d / (2.0 * SSIM_SIGMA * SSIM_SIGMA)).exp()
    });
    let sum: f64 = raw.iter().sum();
    raw.map(|w| F::of(w / sum))
}

/// A pixel as the loss reads it.
#[inline(always)]
fn clean<F: Real>(x: F) -> F {
    if x.abs() <= F::of(PIXEL_MAX) { x } else { F::ZERO }
}

/// Sixteen numbers of `row` from `at`.
#[inline(always)]
fn lanes_at<L: Lanes>(row: &[L::Real], at: usize) -> L {
    L::load(row[at..at + LANES].try_into().expect("sixteen numbers"))
}

/// Sixteen numbers into `row` at `at`.
#[inline(always)]
fn put<L: Lanes>(v: L, row: &mut [L::Real], at: usize) {
    v.store((&mut row[at..at + LANES]).try_into().expect("sixteen numbers"));
}

/// A ring of the last 11 horizontally filtered rows of `K` maps.
struct Ring<F, const K: usize> {
    rows: Vec<F>,
    padded: usize,
}

impl<F: Real, const K: usize> Ring<F, K> {
    fn new(frame: &Frame) -> Self {
        Self { rows: zeros(SSIM_WINDOW * K * frame.padded()), padded: frame.padded() }
    }
    /// Map `k` of image row `y` (negative rows are counted by the caller's offset).
    #[inline(always)]
    fn row(&mut self, y: usize, k: usize) -> &mut [F] {
        let at = (y % SSIM_WINDOW * K + k) * self.padded;
        &mut self.rows[at..at + self.padded]
    }
    /// Vertical filter of the window whose topmost row is `top`, at `at`.
    #[inline(always)]
    fn vertical<L: Lanes<Real = F>>(&self, top: usize, at: usize, taps: &[F; SSIM_WINDOW]) -> [L; K] {
        let mut sums = [L::splat(F::ZERO); K];
        for (i, &w) in taps.iter().enumerate() {
            let w = L::splat(w);
            for (k, sum) in sums.iter_mut().enumerate() {
                let row = ((top + i) % SSIM_WINDOW * K + k) * self.padded;
                *sum = w.mul_add(lanes_at(&self.rows, row + at), *sum);
            }
        }
        sums
    }
}

struct StripForward<'a, F> {
    frame: Frame,
    image: &'a [F],
    target: &'a [F],
    derivatives: [&'a mut [F]; 3],
}

impl<F: Real> LaneTask<F> for StripForward<'_, F> {
    /// Sums of L1 and SSIM over the strip.
    type Output = [f64; 2];

    #[inline(always)]
    fn run<L: Lanes<Real = F>>(self) -> [f64; 2] {
        let Self { frame, image, target, derivatives: [d_mu, d_xx, d_xy] } = self;
        let taps = taps::<F>();
        let (len, lead) = (frame.row(), frame.lead());
        let mut ring = Ring::<F, 5>::new(&frame);
        let shift = F::of(SSIM_SHIFT);
        let (mut x, mut y) = (vec![-shift; frame.spread()], vec![-shift; frame.spread()]);
        let mut maps = [(); 4].map(|()| zeros::<F>(frame.padded()));
        let (mut l1, mut ssim) = (0.0, 0.0);
        // Row `v` here is image row `v - HALO`: the first output row's window starts above the image.
        for v in frame.first..frame.rows().end + 2 * HALO {
            let inside = v >= HALO && v - HALO < frame.height;
            if inside {
                let at = (v - HALO) * len;
                for i in 0..len {
                    x[lead + i] = clean(image[at + i]) - shift;
                    y[lead + i] = clean(target[at + i]) - shift;
                }
                if frame.rows().contains(&(v - HALO)) {
                    l1 += sum_lanes::<L>(&frame, |at| lanes_at::<L>(&x, lead + at).sub(lanes_at(&y, lead + at)).abs());
                }
                horizontal_moments::<L>(&frame, &x, &y, &taps, &mut ring, v);
            } else {
                let outside = [-shift, -shift, shift * shift, shift * shift, shift * shift];
                (0..5).for_each(|k| ring.row(v, k).fill(outside[k]));
            }
            if v < frame.first + 2 * HALO {
                continue;
            }
            let top = v - 2 * HALO;
            for at in (0..frame.padded()).step_by(LANES) {
                let moments = ring.vertical::<L>(top, at, &taps);
                for (map, value) in maps.iter_mut().zip(similarity(moments)) {
                    put(value, map, at);
                }
            }
            maps[3][len..].fill(F::ZERO);
            ssim += sum_lanes::<L>(&frame, |at| lanes_at(&maps[3], at));
            let out = (top - frame.first) * len;
            for (derivative, map) in [&mut *d_mu, &mut *d_xx, &mut *d_xy].into_iter().zip(&maps) {
                derivative[out..out + len].copy_from_slice(&map[..len]);
            }
        }
        [l1, ssim]
    }
}

/// Sum over a padded row, lane by lane.
#[inline(always)]
fn sum_lanes<L: Lanes>(frame: &Frame, value: impl Fn(usize) -> L) -> f64 {
    let mut sum = L::splat(L::Real::ZERO);
    for at in (0..frame.padded()).step_by(LANES) {
        sum = sum.add(value(at));
    }
    sum.sum().to_f64()
}

/// Filters `x`, `y`, `x^2`, `y^2` and `x y` along the row into the ring.
#[inline(always)]
fn horizontal_moments<L: Lanes>(
    frame: &Frame,
    x: &[L::Real],
    y: &[L::Real],
    taps: &[L::Real; SSIM_WINDOW],
    ring: &mut Ring<L::Real, 5>,
    v: usize,
) {
    let zero = L::splat(L::Real::ZERO);
    for at in (0..frame.padded()).step_by(LANES) {
        let mut sums = [zero; 5];
        for (i, &w) in taps.iter().enumerate() {
            let w = L::splat(w);
            let (a, b): (L, L) = (lanes_at(x, at + i * frame.channels), lanes_at(y, at + i * frame.channels));
            let (wa, wb) = (w.mul(a), w.mul(b));
            sums[0] = sums[0].add(wa);
            sums[1] = sums[1].add(wb);
            sums[2] = wa.mul_add(a, sums[2]);
            sums[3] = wb.mul_add(b, sums[3]);
            sums[4] = wa.mul_add(b, sums[4]);
        }
        for (k, sum) in sums.into_iter().enumerate() {
            put(sum, ring.row(v, k), at);
        }
    }
}

/// The derivatives with respect to `mu_x`, `E_xx`, `E_xy`, and SSIM itself, from the shifted `[mu_x, mu_y, E_xx, E_yy,
/// E_xy]`.
#[inline(always)]
fn similarity<L: Lanes>([mx, my, exx, eyy, exy]: [L; 5]) -> [L; 4] {
    let c = |x: f64| L::splat(L::Real::of(x));
    let (one, two) = (c(1.0), c(2.0));
    let (mean_x, mean_y) = (mx.add(c(SSIM_SHIFT)), my.add(c(SSIM_SHIFT)));
    let a1 = two.mul(mean_x).mul_add(mean_y, c(SSIM_C1));
    let a2 = two.mul(mx.neg_mul_add(my, exy)).add(c(SSIM_C2));
    let b1 = mean_x.mul_add(mean_x, mean_y.mul_add(mean_y, c(SSIM_C1)));
    let b2 = mx.neg_mul_add(mx, exx).add(my.neg_mul_add(my, eyy)).add(c(SSIM_C2));
    let (inv1, inv2) = (one.div(b1), one.div(b2));
    let both = inv1.mul(inv2);
    let ssim = a1.mul(a2).mul(both);
    let d_xy = two.mul(a1).mul(both);
    let d_xx = c(0.0).sub(ssim.mul(inv2));
    // The means enter A1 and B1 unshifted, and A2 and B2 shifted.
    let numerator = mean_y.mul(a2).sub(my.mul(a1)).mul(both);
    let denominator = ssim.mul(mean_x.mul(inv1).sub(mx.mul(inv2)));
    let d_mu = two.mul(numerator.sub(denominator));
    [d_mu, d_xx, d_xy, ssim]
}

struct StripBackward<'a, F> {
    frame: Frame,
    image: &'a [F],
    target: &'a [F],
    saved: &'a [F],
    /// Gradients by the sums of L1 and SSIM.
    v: [F; 2],
    v_image: &'a mut [F],
}

impl<F: Real> LaneTask<F> for StripBackward<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Real = F>>(self) {
        let Self { frame, image, target, saved, v: [v_l1, v_ssim], v_image } = self;
        let taps = taps::<F>();
        let (len, lead) = (frame.row(), frame.lead());
        let total = len * frame.height;
        let mut ring = Ring::<F, 3>::new(&frame);
        let mut spread = zeros::<F>(frame.spread());
        let mut maps = [(); 3].map(|()| zeros::<F>(frame.padded()));
        for v in frame.first..frame.rows().end + 2 * HALO {
            let inside = v >= HALO && v - HALO < frame.height;
            for k in 0..3 {
                if inside {
                    let at = k * total + (v - HALO) * len;
                    spread[lead..lead + len].copy_from_slice(&saved[at..at + len]);
                    horizontal::<L>(&frame, &spread, &taps, ring.row(v, k));
                } else {
                    ring.row(v, k).fill(F::ZERO);
                }
            }
            if v < frame.first + 2 * HALO {
                continue;
            }
            let top = v - 2 * HALO;
            for at in (0..frame.padded()).step_by(LANES) {
                for (map, value) in maps.iter_mut().zip(ring.vertical::<L>(top, at, &taps)) {
                    put(value, map, at);
                }
            }
            let out = &mut v_image[(top - frame.first) * len..][..len];
            let (xs, ys) = (&image[top * len..][..len], &target[top * len..][..len]);
            for i in 0..len {
                let (x, y) = (clean(xs[i]), clean(ys[i]));
                let shift = F::of(SSIM_SHIFT);
                let similarity = maps[0][i] + F::of(2.0) * (x - shift) * maps[1][i] + (y - shift) * maps[2][i];
                let sign = if x > y {
                    v_l1
                } else if x < y {
                    -v_l1
                } else {
                    F::ZERO
                };
                out[i] = if x == xs[i] { v_ssim * similarity + sign } else { F::ZERO };
            }
        }
    }
}

/// Filters one row.
#[inline(always)]
fn horizontal<L: Lanes>(frame: &Frame, x: &[L::Real], taps: &[L::Real; SSIM_WINDOW], out: &mut [L::Real]) {
    for at in (0..frame.padded()).step_by(LANES) {
        let mut sum = L::splat(L::Real::ZERO);
        for (i, &w) in taps.iter().enumerate() {
            sum = L::splat(w).mul_add(lanes_at(x, at + i * frame.channels), sum);
        }
        put(sum, out, at);
    }
}
