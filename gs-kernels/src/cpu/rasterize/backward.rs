//! Blending backward.
//!
//! Per tile, the forward walk is replayed, at the blocks that it changed, and every alpha and transmittance is kept (a
//! pixel blends at most 2,346 Gaussians, because each takes 1/255 of the light and the pixel ends at 1e-4), so that
//! nothing is recomputed by division. Then the list is walked back to front with the light behind each Gaussian as one
//! running number `R` per pixel:
//!
//! `q = f . v`, `v_alpha = T (q - R)`, `R += alpha (q - R)`, where `v` is the gradient with respect to the pixel's
//! channels. (The usual form carries the sum `S = T (1 - alpha) R` and divides it by `1 - alpha`.)
//!
//! With `s = -alpha v_alpha = v_sigma` and `u = dx + l dy`, all gradients with respect to the ellipse are moments of
//! `s` over the tile. Every (tile, Gaussian) pair has a gradient row of its own, and a Gaussian's rows are added in
//! tile order ([`super::gather`]), so that sums do not depend on the timing of threads.

use rayon::prelude::*;

use super::gather::{FIXED, RasterizeGradients, gather};
use super::tile::{BLOCKS, FeatureLanes, Inputs, TilePlane, block_and_lane, fresh_transmittance, plane};
use crate::config::RasterizeConfig;
use crate::constants::ALPHA_MAX;
use crate::cpu::Real;
use crate::cpu::blend::TileGaussian;
use crate::cpu::intersect::IntersectionSlices;
use crate::cpu::parallel::{Disjoint, zeros};
use crate::cpu::real::{Aligned, LaneTask, Lanes, Number};
use crate::rows::ProjectedRow;

/// Backward of [`super::forward`] from `v_output`, in the shape of its result; pixels outside the image are not read.
/// `changed` `[M]` is that of [`super::forward_saving`] for the same inputs; without it the blocks are searched again,
/// with the same result.
///
/// A Gaussian whose gradient is not finite receives zero.
///
/// # Panics
/// When the slices disagree in length, or a list is for a tile outside the image.
pub fn backward<F: Real>(
    config: &RasterizeConfig,
    projected: &[F],
    opacities: &[F],
    features: &[F],
    background: &[F],
    lists: IntersectionSlices<'_>,
    v_output: &[F],
    changed: Option<&[i32]>,
) -> RasterizeGradients<F> {
    let inputs = Inputs::new(config, projected, opacities, features, background, lists);
    let values = inputs.pixels() * config.output_channels();
    assert_eq!(v_output.len(), values, "v_output must have the shape of the output");
    let count = lists.gaussian_ids.len();
    assert!(changed.is_none_or(|changed| changed.len() == count), "changed must be [M] for {count} pairs");
    let mut pairs = zeros(count * (FIXED + inputs.blended));
    let shared = Disjoint::new(&mut pairs);
    let backgrounds: Vec<Vec<F>> = (0..inputs.tiles)
        .into_par_iter()
        .map_init(Scratch::default, |scratch, tile| {
            let (inputs, pairs) = (&inputs, &shared);
            match inputs.blended {
                1 => F::with_lanes(TileBackward::<F, 1> { inputs, tile, pairs, v_output, changed, scratch }),
                2 => F::with_lanes(TileBackward::<F, 2> { inputs, tile, pairs, v_output, changed, scratch }),
                3 => F::with_lanes(TileBackward::<F, 3> { inputs, tile, pairs, v_output, changed, scratch }),
                4 => F::with_lanes(TileBackward::<F, 4> { inputs, tile, pairs, v_output, changed, scratch }),
                _ => F::with_lanes(TileBackward::<F, 0> { inputs, tile, pairs, v_output, changed, scratch }),
            }
        })
        .collect();
    let mut v_background: Vec<F> = zeros(config.channels);
    for tile in &backgrounds {
        v_background.iter_mut().zip(tile).for_each(|(sum, &v)| *sum += v);
    }
    if v_background.iter().any(|v| !v.is_finite()) {
        v_background.fill(F::ZERO);
    }
    gather(&inputs, &pairs, v_background)
}

/// State kept by the replay of a tile.
struct Scratch<F> {
    /// Per blended block of a Gaussian: alpha and the transmittance before it.
    steps: Vec<[Aligned<F>; 2]>,
    gaussians: Vec<Replayed<F>>,
    /// Gradient by the pixels, one plane per output channel.
    v: Vec<TilePlane<F>>,
}

impl<F> Default for Scratch<F> {
    fn default() -> Self {
        Self { steps: Vec::new(), gaussians: Vec::new(), v: Vec::new() }
    }
}

struct Replayed<F> {
    id: usize,
    position: usize,
    gaussian: TileGaussian<F>,
    /// Blocks in which some pixel blended it; their steps begin at `first_step`.
    blended: u16,
    first_step: usize,
}

/// One tile; `UNROLL` is the number of blended channels, or 0 for any.
struct TileBackward<'a, F, const UNROLL: usize> {
    inputs: &'a Inputs<'a, F>,
    tile: usize,
    pairs: &'a Disjoint<'a, F>,
    v_output: &'a [F],
    changed: Option<&'a [i32]>,
    scratch: &'a mut Scratch<F>,
}

impl<F: Real, const UNROLL: usize> LaneTask<F> for TileBackward<'_, F, UNROLL> {
    /// The tile's part of the background's gradient, `[C + depth]`.
    type Output = Vec<F>;

    #[inline(always)]
    fn run<L: Lanes<Real = F>>(mut self) -> Vec<F> {
        let origin = self.inputs.origin(self.tile);
        self.load_v(origin);
        let transmittance = self.replay::<L>(origin);
        let (mut behind, v_background) = self.behind_everything::<L>(&transmittance);
        self.walk_back::<L>(&mut behind);
        v_background
    }
}

impl<F: Real, const UNROLL: usize> TileBackward<'_, F, UNROLL> {
    #[inline(always)]
    fn channels(&self) -> usize {
        if UNROLL > 0 { UNROLL } else { self.inputs.blended }
    }

    /// Spreads the pixels' gradients into planes; zero outside the image.
    #[inline(always)]
    fn load_v(&mut self, origin: [usize; 2]) {
        let stride = self.inputs.blended + 1;
        let [columns, rows] = self.inputs.inside(origin);
        let v = &mut self.scratch.v;
        v.clear();
        v.resize(stride, plane(F::ZERO));
        for r in 0..rows {
            let first = self.inputs.row_start(self.tile, origin, r) * stride;
            for (x, pixel) in self.v_output[first..][..columns * stride].chunks_exact(stride).enumerate() {
                let (b, lane) = block_and_lane(x, r);
                for (c, &value) in pixel.iter().enumerate() {
                    v[c][b].0[lane] = value;
                }
            }
        }
    }

    /// Repeats the forward walk, keeping every step; returns the final transmittance, signs as in
    /// [`crate::cpu::blend`].
    #[inline(always)]
    fn replay<L: Lanes<Real = F>>(&mut self, origin: [usize; 2]) -> TilePlane<F> {
        let inputs = self.inputs;
        let Scratch { steps, gaussians, .. } = &mut *self.scratch;
        steps.clear();
        gaussians.clear();
        let (mut transmittance, mut ended) = fresh_transmittance::<F>(inputs.inside(origin));
        let (ids, begin) = inputs.list(self.tile);
        let changed = self.changed.map(|changed| &changed[begin..begin + ids.len()]);
        for (k, &id) in ids.iter().enumerate() {
            // A pair that changed nothing is not read at all.
            let known = changed.map(|changed| changed[k] as u16);
            if known == Some(0) {
                continue;
            }
            inputs.prefetch(ids, k);
            let id = id as usize;
            let (_, gaussian) = inputs.gaussian(id, origin);
            let mut active = match known {
                Some(known) => known,
                None => gaussian.reached::<L>(inputs.limits[id]) & !ended,
            };
            if active == 0 {
                continue;
            }
            let blocks = gaussian.blocks::<L>();
            let first_step = steps.len();
            steps.reserve(BLOCKS);
            let mut blended = 0;
            while active != 0 {
                let b = active.trailing_zeros() as usize % BLOCKS;
                active &= active - 1;
                let t = L::load(&transmittance[b].0);
                let step = gaussian.blend(blocks.u(b), &blocks, b, t);
                step.after.store(&mut transmittance[b].0);
                if step.is_drawn() {
                    blended |= 1 << b;
                    steps.push([Aligned(step.alpha.to_array()), Aligned(t.to_array())]);
                }
                if !step.is_open() {
                    ended |= 1 << b;
                }
            }
            if blended != 0 {
                gaussians.push(Replayed { id, position: begin + k, gaussian, blended, first_step });
            }
            if ended == u16::MAX {
                break;
            }
        }
        transmittance
    }

    /// `R` behind the last Gaussian, `background . v - v_alpha`, and the gradient with respect to the background, `sum
    /// T v`.
    #[inline(always)]
    fn behind_everything<L: Lanes<Real = F>>(&self, transmittance: &TilePlane<F>) -> (TilePlane<F>, Vec<F>) {
        let channels = self.channels();
        let v = &self.scratch.v;
        let mut behind = plane(F::ZERO);
        let mut v_background = vec![F::ZERO; channels];
        for b in 0..BLOCKS {
            let t = L::load(&transmittance[b].0).abs();
            let mut s = L::splat(F::ZERO).sub(L::load(&v[channels][b].0));
            for c in 0..channels {
                let v = L::load(&v[c][b].0);
                s = v.mul_add(L::splat(self.inputs.background[c]), s);
                v_background[c] += t.mul(v).sum();
            }
            s.store(&mut behind[b].0);
        }
        (behind, v_background)
    }

    #[inline(always)]
    fn walk_back<L: Lanes<Real = F>>(&mut self, behind: &mut TilePlane<F>) {
        let channels = self.channels();
        let stride = FIXED + channels;
        let Scratch { steps, gaussians, v } = &*self.scratch;
        let zero = L::splat(F::ZERO);
        let mut features = FeatureLanes::<L, UNROLL>::new(channels);
        let mut v_features = FeatureLanes::<L, UNROLL>::new(channels);
        for replayed in gaussians.iter().rev() {
            let features = features.read(self.inputs, replayed.id);
            let v_features = v_features.lanes();
            for v_feature in &mut *v_features {
                *v_feature = zero;
            }
            let row = ProjectedRow::read(self.inputs.projected, replayed.id);
            let [d1, l, d2] = row.conic;
            // The reached blocks are known; the rest is cheaper to recompute than to keep.
            let blocks = replayed.gaussian.blocks::<L>();
            let mut moments = Moments::<L>::new();
            let mut active = replayed.blended;
            let mut step = replayed.first_step;
            while active != 0 {
                let b = active.trailing_zeros() as usize % BLOCKS;
                active &= active - 1;
                let [alpha, t] = [L::load(&steps[step][0].0), L::load(&steps[step][1].0)];
                step += 1;
                let weight = alpha.mul(t);
                let mut q = zero;
                for ((plane, &feature), v_feature) in v.iter().zip(features).zip(&mut *v_features) {
                    let v = L::load(&plane[b].0);
                    q = v.mul_add(feature, q);
                    *v_feature = weight.mul_add(v, *v_feature);
                }
                let shown = L::load(&behind[b].0);
                let difference = q.sub(shown);
                alpha.mul_add(difference, shown).store(&mut behind[b].0);
                // A capped alpha does not depend on sigma or opacity; where nothing was blended alpha is zero.
                let capped = alpha.ge(L::splat(F::of(ALPHA_MAX)));
                let s = L::select(capped, zero, zero.sub(weight.mul(difference)));
                moments.add(s, blocks.u(b), blocks.dy(b), [d1, l, d2]);
            }
            // SAFETY: every pair of the sorted list belongs to one tile.
            let out = unsafe { self.pairs.slice_mut(replayed.position * stride, stride) };
            let opacity = self.inputs.opacities[replayed.id];
            out[..FIXED].copy_from_slice(&moments.gradients([d1, l, d2], opacity));
            for (out, v_features) in out[FIXED..].chunks_mut(4).zip(v_features.chunks(4)) {
                let mut four = [zero; 4];
                four[..v_features.len()].copy_from_slice(v_features);
                out.copy_from_slice(&L::sums(four)[..out.len()]);
            }
        }
    }
}

/// Moments of `s = v_sigma` over the tile's pixels, lane by lane.
struct Moments<L> {
    s: L,
    s_dy: L,
    s_dy2: L,
    s_u: L,
    s_u_dy: L,
    s_u2: L,
    abs_x: L,
    abs_y: L,
}

impl<L: Lanes> Moments<L> {
    #[inline(always)]
    fn new() -> Self {
        let z = L::splat(L::Real::ZERO);
        Self { s: z, s_dy: z, s_dy2: z, s_u: z, s_u_dy: z, s_u2: z, abs_x: z, abs_y: z }
    }

    #[inline(always)]
    fn add(&mut self, s: L, u: L, y: L, [d1, l, d2]: [L::Real; 3]) {
        let (su, sy) = (s.mul(u), s.mul(y));
        self.s = self.s.add(s);
        self.s_dy = self.s_dy.add(sy);
        self.s_dy2 = sy.mul_add(y, self.s_dy2);
        self.s_u = self.s_u.add(su);
        self.s_u_dy = su.mul_add(y, self.s_u_dy);
        self.s_u2 = su.mul_add(u, self.s_u2);
        self.abs_x = self.abs_x.add(su.abs());
        self.abs_y = self.abs_y.add(su.mul_add(L::splat(d1 * l), sy.mul(L::splat(d2))).abs());
    }

    /// Gradients with respect to mean, conic and opacity, and the absolute screen gradient.
    #[inline(always)]
    fn gradients(&self, [d1, l, d2]: [L::Real; 3], opacity: L::Real) -> [L::Real; FIXED] {
        let half = L::Real::of(0.5);
        let [s, s_dy, s_dy2, s_u] = L::sums([self.s, self.s_dy, self.s_dy2, self.s_u]);
        let [s_u_dy, s_u2, abs_x, abs_y] = L::sums([self.s_u_dy, self.s_u2, self.abs_x, self.abs_y]);
        [
            -(d1 * s_u),
            -(d1 * l * s_u + d2 * s_dy),
            half * s_u2,
            d1 * s_u_dy,
            half * s_dy2,
            -(s / opacity),
            d1 * abs_x,
            abs_y,
        ]
    }
}
