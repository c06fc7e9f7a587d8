//! One Gaussian at one row of sixteen pixels: alpha and transmittance. The forward walk and the backward's replay both
//! call it, so they agree to the bit.

use crate::constants::{ALPHA_MAX, ALPHA_MIN, TILE, TRANSMITTANCE_MIN};
use crate::cpu::Real;
use crate::cpu::lanes::{LANES, Lanes};
use crate::rows::ProjectedRow;

/// Slack of the row test in powers of two; the row test may only ever say yes too often.
const ROW_SLACK: (f64, f64) = (1e-5, 1e-3);

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

    /// Horizontal distance of each lane's pixel from the mean.
    #[inline(always)]
    pub fn dx<L: Lanes<Real = F>>(&self) -> L {
        L::ramp().sub(L::splat(self.offset[0]))
    }

    /// Per tile row: what the row's pixels share, and whether any of them can reach the cut-off.
    ///
    /// `limit` is `log2(opacity / ALPHA_MIN)`.
    #[inline(always)]
    pub fn rows<L: Lanes<Real = F>>(&self, limit: F) -> Rows<F> {
        let dy = L::ramp().sub(L::splat(self.offset[1]));
        let skew = dy.mul(L::splat(self.shear));
        let power = dy.mul(dy).mul(L::splat(self.half_conic[1]));
        // |dx + l dy| is smallest at the row's end nearer to zero, or zero between the ends.
        let first = skew.sub(L::splat(self.offset[0]));
        let last = first.add(L::splat(F::of((TILE - 1) as f64)));
        let zero = L::splat(F::ZERO);
        let nearest = first.max(zero.sub(last)).max(zero);
        let least = nearest.mul(nearest).mul_add(L::splat(self.half_conic[0]), power);
        let limit = limit * F::of(1.0 + ROW_SLACK.0) + F::of(ROW_SLACK.1);
        Rows {
            dy: dy.to_array(),
            skew: skew.to_array(),
            power: zero.sub(power).to_array(),
            reached: L::bits(L::splat(limit).ge(least)),
        }
    }

    /// `dx + l dy` for a row.
    #[inline(always)]
    pub fn u<L: Lanes<Real = F>>(&self, dx: L, rows: &Rows<F>, row: usize) -> L {
        dx.add(L::splat(rows.skew[row]))
    }

    /// Blends the row over what is in front: `t` is the transmittance before.
    #[inline(always)]
    pub fn blend<L: Lanes<Real = F>>(&self, u: L, rows: &Rows<F>, row: usize, t: L) -> Blend<L> {
        let power = u.mul(u).neg_mul_add(L::splat(self.half_conic[0]), L::splat(rows.power[row]));
        let raw = power.exp2_nonpositive().mul(L::splat(self.opacity));
        let alpha = raw.min(L::splat(F::of(ALPHA_MAX)));
        let visible = raw.ge(L::splat(F::of(ALPHA_MIN)));
        let next = alpha.neg_mul_add(t, t);
        let open = next.ge(L::splat(F::of(TRANSMITTANCE_MIN)));
        let zero = L::splat(F::ZERO);
        let after = L::select(open, next, zero.sub(t.abs()));
        Blend { alpha: L::select(L::both(visible, open), alpha, zero), after: L::select(visible, after, t) }
    }
}

/// What the pixels of a tile row share, for all rows.
#[derive(Clone, Copy, Debug)]
pub struct Rows<F> {
    /// Vertical distance from the mean.
    pub dy: [F; LANES],
    skew: [F; LANES],
    power: [F; LANES],
    /// Bit `r`: row `r` can reach the cut-off.
    pub reached: u16,
}

/// One step of blending.
#[derive(Clone, Copy, Debug)]
pub struct Blend<L> {
    /// Alpha where the Gaussian is blended, else 0.
    pub alpha: L,
    /// Transmittance behind it. Negative marks a pixel that has ended; its magnitude is the pixel's final value.
    pub after: L,
}

/// Transmittance of a pixel outside the image: it has ended before it began.
pub const OUTSIDE: f64 = -1.0;

/// Rows of which some pixel is still open.
#[inline(always)]
pub fn is_open<L: Lanes>(t: L) -> bool {
    L::bits(t.ge(L::splat(L::Real::of(TRANSMITTANCE_MIN)))) != 0
}
