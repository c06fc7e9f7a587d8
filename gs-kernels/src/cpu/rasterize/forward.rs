//! Blending forward: colour, depth and alpha of every pixel.

use rayon::prelude::*;

use super::tile::{BLOCKS, FeatureLanes, Inputs, TilePlane, UNROLLED, block_and_lane, fresh_transmittance, plane};
use crate::config::RasterizeConfig;
use crate::cpu::Real;
use crate::cpu::intersect::IntersectionSlices;
use crate::cpu::lanes::Lanes;
use crate::cpu::parallel::{Disjoint, zeros};
use crate::cpu::real::LaneTask;

/// Renders.
///
/// `projected` `[N, 8]`, `opacities` `[N]`, `features` `[N, C]`, `background` `[C]`. Returns `[H, W, C + depth + 1]`: the features
/// over the background, the accumulated depth (no background) if requested, and `alpha = 1 - T`. For lists with `places` it returns
/// `[tiles, 16, 16, C + depth + 1]`: one tile per list, zero in its pixels outside the image.
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
    let inputs = Inputs::new(config, projected, opacities, features, background, lists);
    let mut output = zeros(inputs.pixels() * config.output_channels());
    let pixels = Disjoint::new(&mut output);
    (0..inputs.tiles).into_par_iter().for_each(|tile| match inputs.blended {
        1 => F::with_lanes(TileForward::<F, 1> { inputs: &inputs, tile, pixels: &pixels }),
        2 => F::with_lanes(TileForward::<F, 2> { inputs: &inputs, tile, pixels: &pixels }),
        3 => F::with_lanes(TileForward::<F, 3> { inputs: &inputs, tile, pixels: &pixels }),
        4 => F::with_lanes(TileForward::<F, 4> { inputs: &inputs, tile, pixels: &pixels }),
        _ => F::with_lanes(TileForward::<F, 0> { inputs: &inputs, tile, pixels: &pixels }),
    });
    output
}

/// One tile; `UNROLL` is the number of blended channels, or 0 for any.
struct TileForward<'a, F, const UNROLL: usize> {
    inputs: &'a Inputs<'a, F>,
    tile: usize,
    pixels: &'a Disjoint<'a, F>,
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

        let ids = inputs.list(self.tile).0;
        for (k, &id) in ids.iter().enumerate() {
            inputs.prefetch(ids, k);
            let id = id as usize;
            let (_, gaussian) = inputs.gaussian(id, origin);
            let blocks = gaussian.blocks::<L>(inputs.limits[id]);
            let features = features.read(inputs, id);
            let mut active = blocks.reached & !ended;
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
                if !step.is_open() {
                    ended |= 1 << b;
                }
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
