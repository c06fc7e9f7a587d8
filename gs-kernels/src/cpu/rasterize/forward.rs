//! Blending forward: colour, depth and alpha of every pixel.

use rayon::prelude::*;

use super::tile::{BLOCKS, FeatureLanes, Inputs, TilePlane, UNROLLED, block_and_lane, fresh_transmittance, plane};
use crate::config::RasterizeConfig;
use crate::cpu::Real;
use crate::cpu::intersect::IntersectionSlices;
use crate::cpu::parallel::{Disjoint, zeros};
use crate::cpu::real::{LaneTask, Lanes};

/// Renders.
///
/// `projected` `[N, 8]`, `opacities` `[N]`, `features` `[N, C]`, `background` `[C]`. Returns `[H, W, C + depth + 1]`:
/// the features over the background, the accumulated depth (no background) if requested, and `alpha = 1 - T`. For lists
/// with `places` it returns `[tiles, 16, 16, C + depth + 1]`: one tile per list, zero in its pixels outside the image.
///
/// # Panics
/// When the slices disagree in length, or a list is for a tile outside the image.
pub fn forward<F: Real>(
    config: &RasterizeConfig,
    projected: &[F],
    opacities: &[F],
    features: &[F],
    background: &[F],
    lists: IntersectionSlices<'_>,
) -> Vec<F> {
    walk(&Inputs::new(config, projected, opacities, features, background, lists), None)
}

/// Like [`forward`], with what spares [`backward`](super::backward()) the search for it: for each pair `[M]` the blocks
/// of its tile that it may have changed, as bits; 0 for pairs behind the last visible one.
///
/// # Panics
/// As [`forward`].
pub fn forward_saving<F: Real>(
    config: &RasterizeConfig,
    projected: &[F],
    opacities: &[F],
    features: &[F],
    background: &[F],
    lists: IntersectionSlices<'_>,
) -> (Vec<F>, Vec<i32>) {
    let mut changed = vec![0; lists.gaussian_ids.len()];
    let inputs = Inputs::new(config, projected, opacities, features, background, lists);
    let output = walk(&inputs, Some(&Disjoint::new(&mut changed)));
    (output, changed)
}

fn walk<F: Real>(inputs: &Inputs<'_, F>, changed: Option<&Disjoint<'_, i32>>) -> Vec<F> {
    let mut output = zeros(inputs.pixels() * inputs.config.output_channels());
    let pixels = &Disjoint::new(&mut output);
    (0..inputs.tiles).into_par_iter().for_each(|tile| match inputs.blended {
        1 => F::with_lanes(TileForward::<F, 1> { inputs, tile, pixels, changed }),
        2 => F::with_lanes(TileForward::<F, 2> { inputs, tile, pixels, changed }),
        3 => F::with_lanes(TileForward::<F, 3> { inputs, tile, pixels, changed }),
        4 => F::with_lanes(TileForward::<F, 4> { inputs, tile, pixels, changed }),
        _ => F::with_lanes(TileForward::<F, 0> { inputs, tile, pixels, changed }),
    });
    output
}

/// One tile; `UNROLL` is the number of blended channels, or 0 for any.
struct TileForward<'a, F, const UNROLL: usize> {
    inputs: &'a Inputs<'a, F>,
    tile: usize,
    pixels: &'a Disjoint<'a, F>,
    /// See [`forward_saving`].
    changed: Option<&'a Disjoint<'a, i32>>,
}

impl<F: Real, const UNROLL: usize> LaneTask<F> for TileForward<'_, F, UNROLL> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Real = F>>(self) {
        let inputs = self.inputs;
        let channels = if UNROLL > 0 { UNROLL } else { inputs.blended };
        let origin = inputs.origin(self.tile);
        let (mut transmittance, mut ended) = fresh_transmittance::<F>(inputs.inside(origin));
        let mut small = [plane(F::ZERO); UNROLLED];
        let mut large = if UNROLL > 0 { Vec::new() } else { vec![plane(F::ZERO); channels] };
        let sums: &mut [TilePlane<F>] = if UNROLL > 0 { &mut small[..UNROLL] } else { &mut large };
        let mut features = FeatureLanes::<L, UNROLL>::new(channels);

        let (ids, begin) = inputs.list(self.tile);
        for (k, &id) in ids.iter().enumerate() {
            inputs.prefetch(ids, k);
            let id = id as usize;
            let (_, gaussian) = inputs.gaussian(id, origin);
            let mut active = gaussian.reached::<L>(inputs.limits[id]) & !ended;
            if active == 0 {
                continue;
            }
            let blocks = gaussian.blocks::<L>();
            let features = features.read(inputs, id);
            let mut changed = 0;
            while active != 0 {
                let b = active.trailing_zeros() as usize % BLOCKS;
                active &= active - 1;
                let t = L::load(&transmittance[b].0);
                let step = gaussian.blend(blocks.u(b), &blocks, b, t);
                step.after.store(&mut transmittance[b].0);
                let weight = step.alpha.mul(t);
                for (plane, &feature) in sums.iter_mut().zip(features) {
                    let sum = &mut plane[b].0;
                    weight.mul_add(feature, L::load(sum)).store(sum);
                }
                changed |= i32::from(step.is_visible()) << b;
                if !step.is_open() {
                    ended |= 1 << b;
                }
            }
            if let Some(all) = self.changed {
                // SAFETY: every pair of the sorted list belongs to one tile.
                let own = unsafe { all.slice_mut(begin + k, 1) };
                own[0] = changed;
            }
            if ended == u16::MAX {
                break;
            }
        }
        self.write(origin, &transmittance, sums);
    }
}

impl<F: Real, const UNROLL: usize> TileForward<'_, F, UNROLL> {
    #[inline(always)]
    fn write(&self, origin: [usize; 2], transmittance: &TilePlane<F>, sums: &[TilePlane<F>]) {
        let inputs = self.inputs;
        let [columns, rows] = inputs.inside(origin);
        let stride = inputs.blended + 1;
        for r in 0..rows {
            let first = inputs.row_start(self.tile, origin, r) * stride;
            // SAFETY: this row of this tile belongs to no other task.
            let pixels = unsafe { self.pixels.slice_mut(first, columns * stride) };
            for (x, pixel) in pixels.chunks_exact_mut(stride).enumerate() {
                let (b, lane) = block_and_lane(x, r);
                let t = transmittance[b].0[lane].abs();
                for c in 0..inputs.blended {
                    pixel[c] = sums[c][b].0[lane] + t * inputs.background[c];
                }
                pixel[stride - 1] = F::ONE - t;
            }
        }
    }
}
