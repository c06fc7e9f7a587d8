//! One Gaussian at one block of 4 x 4 pixels: alpha and transmittance. The forward walk and its replay in the backward
//! pass both call it, so they agree to the bit.
//!
//! Blocks are squares instead of rows of sixteen because most Gaussians are a few pixels wide, and touch a third fewer
//! blocks than rows.

use crate::constants::{ALPHA_MAX, ALPHA_MIN, TRANSMITTANCE_MIN};
use crate::cpu::Real;
use crate::cpu::real::{LANES, Lanes};
use crate::rows::ProjectedRow;

/// Edge of a block, pixels; a tile has as many blocks along each side.
pub const EDGE: usize = 4;

/// Slack of the reach test in powers of two; false positives are harmless, false negatives are not.
const REACH_SLACK: (f64, f64) = (1e-5, 1e-3);

/// A Gaussian prepared for one tile.
#[derive(Clone, Copy, Debug)]
pub struct TileGaussian<F> {
    /// Mean relative to the centre of the tile's first pixel.
    pub offset: [F; 2],
    /// `d1 / 2` and `d2 / 2` times `log2 e`, so that alpha is a power of two.
    half_conic: [F; 2],
    /// Shear of the conic.
    pub shear: F,
    opacity: F,
}

impl<F: Real> TileGaussian<F> {
    /// Prepares a row for the tile whose first pixel is (`x`, `y`).
    #[inline(always)]
    pub fn new(row: &ProjectedRow<F>, opacity: F, [x, y]: [usize; 2]) -> Self {
        let scale = F::of(0.5 * std::f64::consts::LOG2_E);
        let origin = |k: usize| F::of(k as f64 + 0.5);
        Self {
            offset: [row.mean[0] - origin(x), row.mean[1] - origin(y)],
            half_conic: [row.conic[0] * scale, row.conic[2] * scale],
            shear: row.conic[1],
            opacity,
        }
    }

    /// The values of the tile's blocks of 4 x 4 pixels.
    #[inline(always)]
    pub fn blocks<L: Lanes<Real = F>>(&self) -> Blocks<L> {
        // One lane per row of the tile.
        let dy = L::ramp().sub(L::splat(self.offset[1]));
        let skew = dy.mul(L::splat(self.shear));
        let power = dy.mul(dy).mul(L::splat(self.half_conic[1]));
        let mut dx = [dy; EDGE];
        for (k, dx) in dx.iter_mut().enumerate() {
            *dx = L::load(&positions(|i| k * EDGE + i % EDGE)).sub(L::splat(self.offset[0]));
        }
        Blocks { dx, dy: dy.to_array(), skew: skew.to_array(), power: L::splat(F::ZERO).sub(power).to_array() }
    }

    /// Blocks that can reach the cut-off, as bits: `|dx + l dy|` and `|dy|` are each at least what they are at the
    /// nearest point of the block. (The two need not be the same point; the exact test takes three times as long, and
    /// spares a thirtieth of the blocks.) `limit` is `log2(opacity / ALPHA_MIN)`.
    #[inline(always)]
    pub fn reached<L: Lanes<Real = F>>(&self, limit: F) -> u16 {
        let zero = L::splat(F::ZERO);
        let reach = F::of((EDGE - 1) as f64);
        let lean = self.shear * reach;
        // One lane per block.
        let dx = L::load(&positions(|i| i % EDGE * EDGE)).sub(L::splat(self.offset[0]));
        let dy = L::load(&positions(|i| i / EDGE * EDGE)).sub(L::splat(self.offset[1]));
        let u = dy.mul_add(L::splat(self.shear), dx);
        let (low, high) = (L::splat(lean.least(F::ZERO)), L::splat(-reach - lean.greatest(F::ZERO)));
        let u = u.add(low).max(high.sub(u)).max(zero);
        let dy = dy.max(L::splat(-reach).sub(dy)).max(zero);
        let along = dy.mul(dy).mul(L::splat(self.half_conic[1]));
        let least = u.mul(u).mul_add(L::splat(self.half_conic[0]), along);
        let limit = limit * F::of(1.0 + REACH_SLACK.0) + F::of(REACH_SLACK.1);
        L::bits(L::splat(limit).ge(least))
    }

    /// Blends block `block` over the Gaussians in front: `u` is its `dx + l dy`, `t` the transmittance before.
    #[inline(always)]
    pub fn blend<L: Lanes<Real = F>>(&self, u: L, blocks: &Blocks<L>, block: usize, t: L) -> Blend<L> {
        let power = u.mul(u).neg_mul_add(L::splat(self.half_conic[0]), blocks.spread(&blocks.power, block));
        let raw = power.exp2_nonpositive().mul(L::splat(self.opacity));
        let zero = L::splat(F::ZERO);
        let visible = raw.ge(L::splat(F::of(ALPHA_MIN)));
        // Lanes that are not visible leave t unchanged, to the bit. (The selection is here and not at the end: a choice
        // between new and old t would be compiled to a masked store, which the next load of this block would have to
        // wait for.)
        let alpha = L::select(visible, raw.min(L::splat(F::of(ALPHA_MAX))), zero);
        let next = alpha.neg_mul_add(t, t);
        let open = next.ge(L::splat(F::of(TRANSMITTANCE_MIN)));
        let after = L::select(open, next, zero.sub(t.abs()));
        Blend { alpha: L::select(open, alpha, zero), after, visible, open }
    }
}

/// The shared values of a tile's blocks: one per column, one per row. Block `b` is the `b % 4`th from the left and the
/// `b / 4`th from the top; its lane `i` is the pixel `i % 4` to the right and `i / 4` down.
#[derive(Clone, Copy, Debug)]
pub struct Blocks<L: Lanes> {
    /// Horizontal distance of each lane's pixel from the mean, by column of blocks.
    dx: [L; EDGE],
    /// Vertical distance from the mean, by row of pixels.
    dy: [L::Real; LANES],
    skew: [L::Real; LANES],
    power: [L::Real; LANES],
}

impl<L: Lanes> Blocks<L> {
    /// `dx + l dy` of a block's pixels.
    #[inline(always)]
    pub fn u(&self, block: usize) -> L {
        self.dx[block % EDGE].add(self.spread(&self.skew, block))
    }

    /// Vertical distance of a block's pixels from the mean.
    #[inline(always)]
    pub fn dy(&self, block: usize) -> L {
        self.spread(&self.dy, block)
    }

    #[inline(always)]
    fn spread(&self, rows: &[L::Real; LANES], block: usize) -> L {
        L::spread(&rows.as_chunks::<EDGE>().0[block / EDGE % EDGE])
    }
}

/// A pixel's coordinate in the tile for each lane.
#[inline(always)]
fn positions<F: Real>(of: impl Fn(usize) -> usize) -> [F; LANES] {
    let mut positions = [F::ZERO; LANES];
    for (i, position) in positions.iter_mut().enumerate() {
        *position = F::of(of(i) as f64);
    }
    positions
}

/// One step of blending.
#[derive(Clone, Copy)]
pub struct Blend<L: Lanes> {
    /// Alpha where the Gaussian is blended, else 0.
    pub alpha: L,
    /// Transmittance behind it. Negative marks a pixel that has ended; its magnitude is the pixel's final value.
    pub after: L,
    visible: L::Mask,
    open: L::Mask,
}

impl<L: Lanes> Blend<L> {
    /// Whether some pixel is still open.
    #[inline(always)]
    pub fn is_open(&self) -> bool {
        L::bits(self.open) != 0
    }

    /// Whether the Gaussian reaches the cut-off at some pixel. Otherwise it is blended at none, and ends none.
    #[inline(always)]
    pub fn is_visible(&self) -> bool {
        L::bits(self.visible) != 0
    }

    /// Whether the Gaussian is blended at some pixel.
    #[inline(always)]
    pub fn is_drawn(&self) -> bool {
        L::bits(L::both(self.visible, self.open)) != 0
    }
}

/// Transmittance of a pixel outside the image, marked as ended.
pub const OUTSIDE: f64 = -1.0;
