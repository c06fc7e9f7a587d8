//! View-dependent colour from real spherical harmonics, forward and backward.
//!
//! `colour = max(0, 1/2 + sum_k Y_k(dir) sh_k)` with `dir` the unit vector from the camera to the Gaussian; signs and
//! order of the basis as in 3DGS, so that its PLY files mean the same here.

use rayon::prelude::*;

use crate::config::ShConfig;
use crate::constants::INVALID_FEATURE;
use crate::cpu::Real;
use crate::cpu::camera::{Pose, PoseGradient};
use crate::cpu::lanes::Lanes;
use crate::cpu::math::{Vec3, dot, row};
use crate::cpu::parallel::{CHUNK, zeros};
use crate::cpu::real::LaneTask;
use crate::rows::ProjectedRow;

/// Coefficients of degree 3.
pub const MAX_COEFFICIENTS: usize = 16;
/// `Y_0`.
pub const SH_C0: f64 = 0.282_094_791_773_878_14;
/// Scale of the linear terms.
pub const SH_C1: f64 = 0.488_602_511_902_919_9;
/// Scales of the quadratic terms.
pub const SH_C2: [f64; 5] = [
    1.092_548_430_592_079_2,
    -1.092_548_430_592_079_2,
    0.315_391_565_252_520_05,
    -1.092_548_430_592_079_2,
    0.546_274_215_296_039_6,
];
/// Scales of the cubic terms.
pub const SH_C3: [f64; 7] = [
    -0.590_043_589_926_643_5,
    2.890_611_442_640_554,
    -0.457_045_799_464_465_8,
    0.373_176_332_590_115_4,
    -0.457_045_799_464_465_8,
    1.445_305_721_320_277,
    -0.590_043_589_926_643_5,
];

/// The basis up to `degree` at the unit vector `[x, y, z]`; the rest is zero.
#[inline(always)]
fn basis<F: Real>(degree: u32, [x, y, z]: Vec3<F>) -> [F; MAX_COEFFICIENTS] {
    let mut b = [F::ZERO; MAX_COEFFICIENTS];
    let c = F::of;
    b[0] = c(SH_C0);
    if degree >= 1 {
        b[1] = c(-SH_C1) * y;
        b[2] = c(SH_C1) * z;
        b[3] = c(-SH_C1) * x;
    }
    if degree >= 2 {
        b[4] = c(SH_C2[0]) * x * y;
        b[5] = c(SH_C2[1]) * y * z;
        b[6] = c(SH_C2[2]) * (c(2.0) * z * z - x * x - y * y);
        b[7] = c(SH_C2[3]) * x * z;
        b[8] = c(SH_C2[4]) * (x * x - y * y);
    }
    if degree >= 3 {
        b[9] = c(SH_C3[0]) * y * (c(3.0) * x * x - y * y);
        b[10] = c(SH_C3[1]) * x * y * z;
        b[11] = c(SH_C3[2]) * y * (c(4.0) * z * z - x * x - y * y);
        b[12] = c(SH_C3[3]) * z * (c(2.0) * z * z - c(3.0) * x * x - c(3.0) * y * y);
        b[13] = c(SH_C3[4]) * x * (c(4.0) * z * z - x * x - y * y);
        b[14] = c(SH_C3[5]) * z * (x * x - y * y);
        b[15] = c(SH_C3[6]) * x * (x * x - c(3.0) * y * y);
    }
    b
}

/// Gradient by the unit vector from the gradient `v` by [`basis`].
#[inline(always)]
fn basis_vjp<F: Real>(degree: u32, [x, y, z]: Vec3<F>, v: &[F; MAX_COEFFICIENTS]) -> Vec3<F> {
    let c = F::of;
    let (mut gx, mut gy, mut gz) = (F::ZERO, F::ZERO, F::ZERO);
    if degree >= 1 {
        gy += c(-SH_C1) * v[1];
        gz += c(SH_C1) * v[2];
        gx += c(-SH_C1) * v[3];
    }
    if degree >= 2 {
        let mut k = [F::ZERO; 5];
        for i in 0..5 {
            k[i] = c(SH_C2[i]) * v[4 + i];
        }
        let [k4, k5, k6, k7, k8] = k;
        let two = c(2.0);
        gx += k4 * y - two * k6 * x + k7 * z + two * k8 * x;
        gy += k4 * x + k5 * z - two * k6 * y - two * k8 * y;
        gz += k5 * y + c(4.0) * k6 * z + k7 * x;
    }
    if degree >= 3 {
        let mut k = [F::ZERO; 7];
        for i in 0..7 {
            k[i] = c(SH_C3[i]) * v[9 + i];
        }
        let [k9, k10, k11, k12, k13, k14, k15] = k;
        let (xx, yy, zz, xy, xz, yz) = (x * x, y * y, z * z, x * y, x * z, y * z);
        let (two, three, six, eight) = (c(2.0), c(3.0), c(6.0), c(8.0));
        gx += six * k9 * xy + k10 * yz - two * k11 * xy - six * k12 * xz
            + k13 * (c(4.0) * zz - three * xx - yy)
            + two * k14 * xz
            + three * k15 * (xx - yy);
        gy += three * k9 * (xx - yy) + k10 * xz + k11 * (c(4.0) * zz - xx - three * yy)
            - six * k12 * yz
            - two * k13 * xy
            - two * k14 * yz
            - six * k15 * xy;
        gz += k10 * xy
            + eight * k11 * yz
            + k12 * (six * zz - three * xx - three * yy)
            + eight * k13 * xz
            + k14 * (xx - yy);
    }
    [gx, gy, gz]
}

/// Unit vector from the camera, and the distance; at the camera itself the direction is zero and has no gradient.
#[inline(always)]
fn direction<F: Real>(mean: Vec3<F>, centre: Vec3<F>) -> (Vec3<F>, F) {
    let offset = [mean[0] - centre[0], mean[1] - centre[1], mean[2] - centre[2]];
    let distance = dot(offset, offset).sqrt();
    if distance > F::ZERO && distance.is_finite() {
        ([offset[0] / distance, offset[1] / distance, offset[2] / distance], distance)
    } else {
        ([F::ZERO; 3], F::ONE)
    }
}

/// `1/2 + sum_k b_k sh_k` over the first `USED` coefficients.
#[inline(always)]
fn raw_colour<F: Real, const USED: usize>(b: &[F; MAX_COEFFICIENTS], sh: &[F]) -> Vec3<F> {
    let sh = &sh[..3 * USED];
    let mut colour = [F::of(0.5); 3];
    for k in 0..USED {
        for c in 0..3 {
            colour[c] += b[k] * sh[3 * k + c];
        }
    }
    colour
}

/// Evaluates `$body` with `$used` standing for the number of coefficients in use, a constant: loops of known length are
/// unrolled.
macro_rules! with_used {
    ($config:expr, $used:ident => $body:expr) => {
        match $config.degree {
            0 => {
                const $used: usize = 1;
                $body
            }
            1 => {
                const $used: usize = 4;
                $body
            }
            2 => {
                const $used: usize = 9;
                $body
            }
            _ => {
                const $used: usize = 16;
                $body
            }
        }
    };
}

fn check<F>(means: &[F], sh: &[F], projected: &[F], config: &ShConfig) -> usize {
    let count = means.len() / 3;
    assert_eq!(sh.len(), count * config.coefficients * 3, "sh must be [N, S, 3] for {count} means");
    assert_eq!(projected.len(), count * crate::rows::PROJECTED, "projected must be [N, 8] for {count} means");
    assert!(used(config) <= config.coefficients, "active degree above the stored one");
    count
}

fn used(config: &ShConfig) -> usize {
    ((config.degree.min(3) + 1) * (config.degree.min(3) + 1)) as usize
}

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

/// Gaussians from `first` on.
struct Chunk<'a, F> {
    means: &'a [F],
    sh: &'a [F],
    projected: &'a [F],
    config: &'a ShConfig,
    centre: Vec3<F>,
    first: usize,
}

/// As many Gaussians as `colours` holds. A lane task only for the processor's instructions: the compiler finds its own
/// lanes among the coefficients.
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

/// Gradients of [`forward`], each in the shape of its argument.
#[derive(Clone, Debug)]
pub struct ShGradients<F> {
    /// `[N, 3]`, through the view direction.
    pub means: Vec<F>,
    /// `[N, S, 3]`; zero above the active degree.
    pub sh: Vec<F>,
    /// `[4, 4]`, through the camera centre.
    pub viewmat: Vec<F>,
}

/// Backward of [`forward`] from `v_colors` `[N, 3]`. A channel held at 0 passes nothing.
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

/// As many Gaussians as the gradients hold; see [`ChunkForward`].
struct ChunkBackward<'a, F, const USED: usize> {
    chunk: Chunk<'a, F>,
    v_colors: &'a [F],
    v_means: &'a mut [F],
    v_sh: &'a mut [F],
}

impl<F: Real, const USED: usize> LaneTask<F> for ChunkBackward<'_, F, USED> {
    /// The chunk's share of the gradient by the camera's centre.
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

/// Gradient by the pose from the gradient by the camera's centre `-R^T t`.
fn centre_vjp<F: Real>(pose: &Pose<F>, v: Vec3<F>) -> PoseGradient<F> {
    PoseGradient {
        rotation: std::array::from_fn(|i| std::array::from_fn(|j| -v[j] * pose.translation[i])),
        translation: std::array::from_fn(|i| -dot(pose.rotation[i], v)),
    }
}
