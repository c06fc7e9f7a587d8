//! Coefficients to colours.

use rayon::prelude::*;

use super::basis::{basis, direction, raw_colour};
use super::chunk::{Chunk, check, with_used};
use crate::config::ShConfig;
use crate::constants::INVALID_FEATURE;
use crate::cpu::Real;
use crate::cpu::camera::Pose;
use crate::cpu::math::row;
use crate::cpu::parallel::{CHUNK, zeros};
use crate::cpu::real::{LaneTask, Lanes};
use crate::rows::ProjectedRow;

/// Colours `[N, 3]` seen from the camera.
///
/// `means` `[N, 3]`, `sh` `[N, S, 3]`, `viewmat` `[4, 4]`, `projected` `[N, 8]` (only its culling is read). Culled
/// Gaussians get 0; one whose colour is not finite gets [`INVALID_FEATURE`], which the intersection test leaves out.
///
/// # Panics
/// When the slices disagree in length.
pub fn forward<F: Real>(means: &[F], sh: &[F], viewmat: &[F], projected: &[F], config: &ShConfig) -> Vec<F> {
    let count = check(means, sh, projected, config);
    let centre = Pose::read(viewmat).centre();
    let mut colours = zeros(count * 3);
    colours.par_chunks_mut(CHUNK * 3).enumerate().for_each(|(chunk, colours)| {
        let chunk = Chunk { means, sh, projected, config, centre, first: chunk * CHUNK };
        with_used!(config, USED => F::with_lanes(ChunkForward::<F, USED> { chunk, colours }));
    });
    colours
}

/// As many Gaussians as `colours` holds. It is a lane task only for the processor's instructions: the compiler
/// vectorises over the coefficients.
struct ChunkForward<'a, F, const USED: usize> {
    chunk: Chunk<'a, F>,
    colours: &'a mut [F],
}

impl<F: Real, const USED: usize> LaneTask<F> for ChunkForward<'_, F, USED> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Real = F>>(self) {
        let Chunk { means, sh, projected, config, centre, first } = self.chunk;
        let stride = config.coefficients * 3;
        for (k, out) in self.colours.chunks_exact_mut(3).enumerate() {
            let i = first + k;
            if ProjectedRow::read(projected, i).radius == F::ZERO {
                continue;
            }
            let (dir, _) = direction(row(means, i), centre);
            let colour = raw_colour::<F, USED>(&basis(config.degree, dir), &sh[i * stride..][..stride]);
            let valid = colour[0].is_finite() && colour[1].is_finite() && colour[2].is_finite();
            for c in 0..3 {
                out[c] = if valid { colour[c].greatest(F::ZERO) } else { F::of(INVALID_FEATURE) };
            }
        }
    }
}
