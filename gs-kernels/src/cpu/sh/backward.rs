//! From gradients with respect to the colours to gradients with respect to coefficients, means and pose.

use rayon::prelude::*;

use super::basis::{MAX_COEFFICIENTS, basis, basis_vjp, direction, raw_colour};
use super::chunk::{Chunk, check, with_used};
use crate::config::ShConfig;
use crate::cpu::Real;
use crate::cpu::camera::{Pose, PoseGradient};
use crate::cpu::math::{Vec3, dot, row};
use crate::cpu::parallel::{CHUNK, zeros};
use crate::cpu::real::{LaneTask, Lanes};
use crate::rows::ProjectedRow;

/// Gradients of [`super::forward`], each in the shape of its argument.
#[derive(Clone, Debug)]
pub struct ShGradients<F> {
    /// `[N, 3]`, through the view direction.
    pub means: Vec<F>,
    /// `[N, S, 3]`; zero above the active degree.
    pub sh: Vec<F>,
    /// `[4, 4]`, through the camera centre.
    pub viewmat: Vec<F>,
}

/// Backward of [`super::forward`] from `v_colors` `[N, 3]`. A channel clamped at 0 passes no gradient.
///
/// # Panics
/// When the slices disagree in length.
pub fn backward<F: Real>(
    means: &[F],
    sh: &[F],
    viewmat: &[F],
    projected: &[F],
    config: &ShConfig,
    v_colors: &[F],
) -> ShGradients<F> {
    let count = check(means, sh, projected, config);
    assert_eq!(v_colors.len(), count * 3, "v_colors must be [N, 3]");
    let pose = Pose::read(viewmat);
    let centre = pose.centre();
    let stride = config.coefficients * 3;
    let (mut v_means, mut v_sh) = (zeros(count * 3), zeros(count * stride));
    let centres: Vec<Vec3<F>> = v_means
        .par_chunks_mut(CHUNK * 3)
        .zip(v_sh.par_chunks_mut(CHUNK * stride))
        .enumerate()
        .map(|(chunk, (v_means, v_sh))| {
            let chunk = Chunk { means, sh, projected, config, centre, first: chunk * CHUNK };
            with_used!(config, USED => F::with_lanes(ChunkBackward::<F, USED> { chunk, v_colors, v_means, v_sh }))
        })
        .collect();
    let mut v_centre = [F::ZERO; 3];
    centres.iter().for_each(|v| (0..3).for_each(|c| v_centre[c] += v[c]));
    ShGradients { means: v_means, sh: v_sh, viewmat: centre_vjp(&pose, v_centre).into_viewmat() }
}

/// As many Gaussians as the gradients hold. It is a lane task only for the processor's instructions, as in the forward
/// pass.
struct ChunkBackward<'a, F, const USED: usize> {
    chunk: Chunk<'a, F>,
    v_colors: &'a [F],
    v_means: &'a mut [F],
    v_sh: &'a mut [F],
}

impl<F: Real, const USED: usize> LaneTask<F> for ChunkBackward<'_, F, USED> {
    /// The chunk's part of the gradient with respect to the camera's centre.
    type Output = Vec3<F>;

    #[inline(always)]
    fn run<L: Lanes<Real = F>>(self) -> Vec3<F> {
        let Chunk { means, sh, projected, config, centre, first } = self.chunk;
        let stride = config.coefficients * 3;
        let mut v_centre = [F::ZERO; 3];
        for (k, v_mean) in self.v_means.chunks_exact_mut(3).enumerate() {
            let i = first + k;
            let v_colour: Vec3<F> = row(self.v_colors, i);
            if ProjectedRow::read(projected, i).radius == F::ZERO || v_colour == [F::ZERO; 3] {
                continue;
            }
            let coefficients = &sh[i * stride..][..3 * USED];
            let (dir, distance) = direction(row(means, i), centre);
            let b = basis(config.degree, dir);
            let colour = raw_colour::<F, USED>(&b, coefficients);
            let (mut v, mut finite) = (v_colour, true);
            for c in 0..3 {
                finite &= colour[c].is_finite() && v_colour[c].is_finite();
                v[c] = if colour[c] > F::ZERO { v_colour[c] } else { F::ZERO };
            }
            if !finite {
                continue;
            }
            let mut v_basis = [F::ZERO; MAX_COEFFICIENTS];
            let v_coefficients = &mut self.v_sh[k * stride..][..3 * USED];
            for j in 0..USED {
                for c in 0..3 {
                    v_coefficients[3 * j + c] = b[j] * v[c];
                    v_basis[j] += coefficients[3 * j + c] * v[c];
                }
            }
            if config.degree == 0 {
                continue;
            }
            let v_dir = basis_vjp(config.degree, dir, &v_basis);
            let along = dot(dir, v_dir);
            let mut v = [F::ZERO; 3];
            for c in 0..3 {
                v[c] = (v_dir[c] - dir[c] * along) / distance;
            }
            if v[0].is_finite() && v[1].is_finite() && v[2].is_finite() {
                v_mean.copy_from_slice(&v);
                for c in 0..3 {
                    v_centre[c] -= v[c];
                }
            }
        }
        v_centre
    }
}

/// Gradient with respect to the pose from that with respect to the camera's centre `-R^T t`.
fn centre_vjp<F: Real>(pose: &Pose<F>, v: Vec3<F>) -> PoseGradient<F> {
    PoseGradient {
        rotation: std::array::from_fn(|i| std::array::from_fn(|j| -v[j] * pose.translation[i])),
        translation: std::array::from_fn(|i| -dot(pose.rotation[i], v)),
    }
}
