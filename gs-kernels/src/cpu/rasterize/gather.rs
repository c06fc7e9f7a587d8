//! From the pairs' gradient rows to the gradients of each Gaussian.

use rayon::prelude::*;

use super::tile::Inputs;
use crate::cpu::Real;
use crate::cpu::parallel::{CHUNK, Disjoint, prefetch, zeros};
use crate::rows::{PROJECTED, ProjectedRow, SCREEN};

/// Gradients of [`super::forward`], each in the shape of its argument.
#[derive(Clone, Debug)]
pub struct RasterizeGradients<F> {
    /// `[N, 8]`; zero for compensation and radius.
    pub projected: Vec<F>,
    /// `[N]`
    pub opacities: Vec<F>,
    /// `[N, C]`
    pub features: Vec<F>,
    /// `[C]`
    pub background: Vec<F>,
    /// `[N, 4]`, see [`SCREEN`].
    pub screen: Vec<F>,
}

/// A pair's gradient row: mean (2), conic (3), opacity, absolute screen gradient (2), then the blended channels.
pub(super) const FIXED: usize = 8;

/// Prefetch distance in rows: adding one takes a few ns, a memory access about a hundred.
const GATHER_AHEAD: usize = 16;

/// Adds each Gaussian's pair rows in tile order.
pub(super) fn gather<F: Real>(inputs: &Inputs<'_, F>, pairs: &[F], background: Vec<F>) -> RasterizeGradients<F> {
    let (count, channels) = (inputs.opacities.len(), inputs.config.channels);
    let stride = FIXED + inputs.blended;
    let mut out = RasterizeGradients {
        projected: zeros(count * PROJECTED),
        opacities: zeros(count),
        features: zeros(count * channels),
        background,
        screen: zeros(count * SCREEN),
    };
    let (rows, opacities, features, screen) = (
        Disjoint::new(&mut out.projected),
        Disjoint::new(&mut out.opacities),
        Disjoint::new(&mut out.features),
        Disjoint::new(&mut out.screen),
    );
    (0..count.div_ceil(CHUNK)).into_par_iter().for_each(|chunk| {
        let mut sum = vec![F::ZERO; stride];
        for id in chunk * CHUNK..((chunk + 1) * CHUNK).min(count) {
            let begin = inputs.lists.gaussian_offsets[id] as usize;
            let end = inputs.lists.gaussian_offsets[id + 1] as usize;
            if begin == end {
                continue;
            }
            sum.fill(F::ZERO);
            for (k, &position) in inputs.lists.positions[begin..end].iter().enumerate() {
                // The positions of the next Gaussian follow in the same list.
                if let Some(&ahead) = inputs.lists.positions.get(begin + k + GATHER_AHEAD) {
                    prefetch(pairs, ahead as usize * stride);
                    prefetch(pairs, (ahead as usize + 1) * stride - 1);
                }
                let pair = &pairs[position as usize * stride..][..stride];
                sum.iter_mut().zip(pair).for_each(|(sum, &v)| *sum += v);
            }
            if !sum.iter().all(|v| v.is_finite()) {
                continue;
            }
            let depth = if inputs.config.depth { sum[FIXED + channels] } else { F::ZERO };
            let row = ProjectedRow {
                mean: [sum[0], sum[1]],
                conic: [sum[2], sum[3], sum[4]],
                depth,
                compensation: F::ZERO,
                radius: F::ZERO,
            };
            // SAFETY: every Gaussian belongs to one chunk.
            unsafe {
                rows.slice_mut(id * PROJECTED, PROJECTED).copy_from_slice(&row.pack());
                opacities.slice_mut(id, 1)[0] = sum[5];
                features.slice_mut(id * channels, channels).copy_from_slice(&sum[FIXED..FIXED + channels]);
                screen.slice_mut(id * SCREEN, SCREEN).copy_from_slice(&[sum[0], sum[1], sum[6], sum[7]]);
            }
        }
    });
    out
}
