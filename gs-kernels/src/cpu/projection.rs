//! 3D Gaussians to 2D ellipses (EWA), forward and backward; one Gaussian at a time, in fixed chunks over threads.

use rayon::prelude::*;

use crate::config::ProjectionConfig;
use crate::constants::{CUTOFF_SIGMAS, QUAT_NORM2_MAX, QUAT_NORM2_MIN};
use crate::cpu::camera::{Pinhole, Pose, PoseGradient};
use crate::cpu::covariance::{self, Projected2d};
use crate::cpu::math::{Mat3, Vec3, mat_t_vec, normalise_vjp, rotation, rotation_vjp, row};
use crate::cpu::parallel::{CHUNK, zeros};
use crate::cpu::real::Real;
use crate::rows::{PROJECTED, ProjectedRow};

/// What one Gaussian goes through, kept so that the backward pass repeats the forward's roundings exactly.
struct Path<F> {
    unit_quat: [F; 4],
    quat_norm: F,
    rotation: Mat3<F>,
    scales: Vec3<F>,
    p: Vec3<F>,
    jacobian: [Vec3<F>; 2],
    ellipse: Projected2d<F>,
}

struct Projector<F> {
    pose: Pose<F>,
    pinhole: Pinhole<F>,
    near: F,
    far: F,
    eps2d: F,
    size: [F; 2],
    antialiased: bool,
}

impl<F: Real> Projector<F> {
    fn new(viewmat: &[F], config: &ProjectionConfig) -> Self {
        Self {
            pose: Pose::read(viewmat),
            pinhole: Pinhole::new(config),
            near: F::of(config.near),
            far: F::of(config.far),
            eps2d: F::of(config.eps2d),
            size: [F::of(config.width.into()), F::of(config.height.into())],
            antialiased: config.antialiased,
        }
    }

    /// `None` for a Gaussian that cannot be drawn. Comparisons are written so that NaN fails them.
    #[inline(always)]
    fn path(&self, mean: Vec3<F>, quat: [F; 4], log_scales: Vec3<F>) -> Option<Path<F>> {
        let p = self.pose.apply(mean);
        if !(p[2] >= self.near && p[2] <= self.far) {
            return None;
        }
        let norm2 = quat[0] * quat[0] + quat[1] * quat[1] + quat[2] * quat[2] + quat[3] * quat[3];
        if !(norm2 >= F::of(QUAT_NORM2_MIN) && norm2 <= F::of(QUAT_NORM2_MAX)) {
            return None;
        }
        let quat_norm = norm2.sqrt();
        let unit_quat = quat.map(|q| q / quat_norm);
        let rotation = rotation(unit_quat);
        let scales = log_scales.map(|s| s.exp());
        let jacobian = self.pinhole.jacobian(p, &self.pose.rotation);
        let ellipse = covariance::project(&rotation, scales, jacobian, self.eps2d)?;
        Some(Path { unit_quat, quat_norm, rotation, scales, p, jacobian, ellipse })
    }

    /// The packed row; `None` when the ellipse misses the image or overflows.
    #[inline(always)]
    fn row(&self, path: &Path<F>) -> Option<[F; PROJECTED]> {
        let reach = [path.ellipse.cov[0], path.ellipse.cov[2]].map(|c| F::of(CUTOFF_SIGMAS) * c.sqrt());
        let mean: [F; 2] =
            std::array::from_fn(|k| self.pinhole.focal[k] * (path.p[k] / path.p[2]) + self.pinhole.principal[k]);
        let seen = |k: usize| mean[k] + reach[k] > F::ZERO && mean[k] - reach[k] < self.size[k];
        if !(seen(0) && seen(1)) {
            return None;
        }
        let row = ProjectedRow {
            mean,
            conic: path.ellipse.conic,
            depth: path.p[2],
            compensation: if self.antialiased { path.ellipse.compensation() } else { F::ONE },
            radius: reach[0].greatest(reach[1]),
        }
        .pack();
        row.iter().all(|x| x.is_finite()).then_some(row)
    }
}

/// Projects every Gaussian.
///
/// `means` `[N, 3]`, `quats` `[N, 4]` (w x y z, any norm), `log_scales` `[N, 3]`, `viewmat` `[4, 4]` world to camera.
/// Returns packed [`ProjectedRow`]s `[N, 8]`; a culled Gaussian's row is zero.
///
/// # Panics
/// When the slices disagree in length.
pub fn forward<F: Real>(
    means: &[F],
    quats: &[F],
    log_scales: &[F],
    viewmat: &[F],
    config: &ProjectionConfig,
) -> Vec<F> {
    let count = check(means, quats, log_scales);
    let projector = Projector::new(viewmat, config);
    let mut rows = zeros(count * PROJECTED);
    rows.par_chunks_mut(CHUNK * PROJECTED).enumerate().for_each(|(chunk, rows)| {
        for (k, out) in rows.chunks_exact_mut(PROJECTED).enumerate() {
            let i = chunk * CHUNK + k;
            let path = projector.path(row(means, i), row(quats, i), row(log_scales, i));
            if let Some(row) = path.and_then(|path| projector.row(&path)) {
                out.copy_from_slice(&row);
            }
        }
    });
    rows
}

/// Gradients of [`forward`], each in the shape of its argument.
#[derive(Clone, Debug)]
pub struct ProjectionGradients<F> {
    /// `[N, 3]`
    pub means: Vec<F>,
    /// `[N, 4]`
    pub quats: Vec<F>,
    /// `[N, 3]`
    pub log_scales: Vec<F>,
    /// `[4, 4]`; the last row is zero.
    pub viewmat: Vec<F>,
}

/// Backward of [`forward`]: `projected` is its result, `v_projected` `[N, 8]` the gradient by it.
///
/// Culled Gaussians receive zero, and so does one whose gradient is not finite.
///
/// # Panics
/// When the slices disagree in length.
pub fn backward<F: Real>(
    means: &[F],
    quats: &[F],
    log_scales: &[F],
    viewmat: &[F],
    config: &ProjectionConfig,
    projected: &[F],
    v_projected: &[F],
) -> ProjectionGradients<F> {
    let count = check(means, quats, log_scales);
    assert_eq!(projected.len(), count * PROJECTED, "projected must be [N, 8]");
    assert_eq!(v_projected.len(), count * PROJECTED, "v_projected must be [N, 8]");
    let projector = Projector::new(viewmat, config);
    let (mut v_means, mut v_quats, mut v_log_scales) = (zeros(count * 3), zeros(count * 4), zeros(count * 3));
    let poses: Vec<PoseGradient<F>> = v_means
        .par_chunks_mut(CHUNK * 3)
        .zip(v_quats.par_chunks_mut(CHUNK * 4))
        .zip(v_log_scales.par_chunks_mut(CHUNK * 3))
        .enumerate()
        .map(|(chunk, ((v_means, v_quats), v_log_scales))| {
            let mut pose = PoseGradient::default();
            for k in 0..v_means.len() / 3 {
                let i = chunk * CHUNK + k;
                if ProjectedRow::read(projected, i).radius == F::ZERO {
                    continue;
                }
                let v = ProjectedRow::read(v_projected, i);
                // Hidden behind others: a trained scene has many, and all that follows is linear in v.
                if v.pack() == [F::ZERO; PROJECTED] {
                    continue;
                }
                let gradient = one_backward(&projector, row(means, i), row(quats, i), row(log_scales, i), v);
                if let Some(g) = gradient {
                    v_means[k * 3..][..3].copy_from_slice(&g.mean);
                    v_quats[k * 4..][..4].copy_from_slice(&g.quat);
                    v_log_scales[k * 3..][..3].copy_from_slice(&g.log_scales);
                    pose.add(&g.pose);
                }
            }
            pose
        })
        .collect();
    let mut pose = PoseGradient::default();
    poses.iter().for_each(|p| pose.add(p));
    ProjectionGradients { means: v_means, quats: v_quats, log_scales: v_log_scales, viewmat: pose.into_viewmat() }
}

struct OneGradient<F> {
    mean: Vec3<F>,
    quat: [F; 4],
    log_scales: Vec3<F>,
    pose: PoseGradient<F>,
}

#[inline(always)]
fn one_backward<F: Real>(
    projector: &Projector<F>,
    mean: Vec3<F>,
    quat: [F; 4],
    log_scales: Vec3<F>,
    v: ProjectedRow<F>,
) -> Option<OneGradient<F>> {
    let path = projector.path(mean, quat, log_scales)?;
    let v_compensation = if projector.antialiased { v.compensation } else { F::ZERO };
    let ellipse =
        covariance::project_vjp(&path.rotation, path.scales, path.jacobian, &path.ellipse, v.conic, v_compensation);

    let p = path.p;
    let mut v_p = [F::ZERO, F::ZERO, v.depth];
    for k in 0..2 {
        let scale = projector.pinhole.focal[k] / p[2];
        v_p[k] += v.mean[k] * scale;
        v_p[2] -= v.mean[k] * scale * (p[k] / p[2]);
    }
    let mut pose = PoseGradient::default();
    projector.pinhole.jacobian_vjp(p, &projector.pose.rotation, ellipse.a, &mut v_p, &mut pose.rotation);
    for i in 0..3 {
        pose.translation[i] = v_p[i];
        for j in 0..3 {
            pose.rotation[i][j] += v_p[i] * mean[j];
        }
    }
    let gradient = OneGradient {
        mean: mat_t_vec(&projector.pose.rotation, v_p),
        quat: normalise_vjp(path.unit_quat, path.quat_norm, rotation_vjp(path.unit_quat, &ellipse.rotation)),
        log_scales: ellipse.log_scales,
        pose,
    };
    let all = gradient.mean.iter().chain(&gradient.quat).chain(&gradient.log_scales);
    let pose = gradient.pose.rotation.iter().flatten().chain(&gradient.pose.translation);
    all.chain(pose).all(|x| x.is_finite()).then_some(gradient)
}

fn check<F>(means: &[F], quats: &[F], log_scales: &[F]) -> usize {
    let count = means.len() / 3;
    assert_eq!(means.len(), count * 3, "means must be [N, 3]");
    assert_eq!(quats.len(), count * 4, "quats must be [N, 4] for {count} means");
    assert_eq!(log_scales.len(), count * 3, "log_scales must be [N, 3] for {count} means");
    count
}
