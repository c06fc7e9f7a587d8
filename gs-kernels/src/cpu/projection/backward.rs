//! From gradients with respect to the rows to gradients with respect to the parameters and the pose.

use rayon::prelude::*;

use super::batch::{MEAN, QUAT, SCALES, Scene, gather, load, scatter};
use super::path::{Path, Projector};
use crate::config::ProjectionConfig;
use crate::cpu::camera::PoseGradient;
use crate::cpu::covariance;
use crate::cpu::math::{Vec3, mat_t_vec, normalise_vjp, rotation_vjp};
use crate::cpu::parallel::{CHUNK, zeros};
use crate::cpu::real::{LANES, LaneTask, Lanes, Number, Real};
use crate::cpu::wide::Wide;
use crate::rows::{PROJECTED, ProjectedRow};

/// Gradients of [`super::forward`], each in the shape of its argument.
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

/// Backward of [`super::forward`]: `projected` is its result, `v_projected` `[N, 8]` the gradient with respect to it.
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
    let (scene, count) = Scene::new(means, quats, log_scales, viewmat, config);
    assert_eq!(projected.len(), count * PROJECTED, "projected must be [N, 8]");
    assert_eq!(v_projected.len(), count * PROJECTED, "v_projected must be [N, 8]");
    let (mut v_means, mut v_quats, mut v_log_scales) =
        (zeros(count * MEAN), zeros(count * QUAT), zeros(count * SCALES));
    let poses: Vec<PoseGradient<F>> = v_means
        .par_chunks_mut(CHUNK * MEAN)
        .zip(v_quats.par_chunks_mut(CHUNK * QUAT))
        .zip(v_log_scales.par_chunks_mut(CHUNK * SCALES))
        .enumerate()
        .map(|(chunk, ((means, quats), log_scales))| {
            let (scene, first) = (&scene, chunk * CHUNK);
            F::with_lanes(ChunkBackward { scene, first, projected, v_projected, means, quats, log_scales })
        })
        .collect();
    let mut pose = PoseGradient::default();
    poses.iter().for_each(|p| pose.add(p));
    ProjectionGradients { means: v_means, quats: v_quats, log_scales: v_log_scales, viewmat: pose.into_viewmat() }
}

/// Gaussians from `first` on, as many as the gradients hold.
pub(super) struct ChunkBackward<'a, F> {
    pub(super) scene: &'a Scene<'a, F>,
    pub(super) first: usize,
    pub(super) projected: &'a [F],
    pub(super) v_projected: &'a [F],
    pub(super) means: &'a mut [F],
    pub(super) quats: &'a mut [F],
    pub(super) log_scales: &'a mut [F],
}

impl<F: Real> LaneTask<F> for ChunkBackward<'_, F> {
    /// The chunk's part of the pose's gradient.
    type Output = PoseGradient<F>;

    #[inline(always)]
    fn run<L: Lanes<Real = F>>(self) -> PoseGradient<F> {
        let projector = Projector::<L>::new(self.scene);
        let mut pose = PoseGradient::zero();
        let end = self.first + self.means.len() / MEAN;
        let mut next = self.first;
        loop {
            // Lanes are filled with the next Gaussians that are drawn and have a gradient: in a trained scene many are
            // hidden behind others, and the rest of the pass is linear in v.
            let (mut ids, mut count) = ([0_u32; LANES], 0);
            while next < end && count < LANES {
                let v = &self.v_projected[next * PROJECTED..][..PROJECTED];
                let mut any = false;
                for x in v {
                    any |= *x != F::ZERO;
                }
                if any && ProjectedRow::read(self.projected, next).radius != F::ZERO {
                    ids[count] = next as u32;
                    count += 1;
                }
                next += 1;
            }
            if count == 0 {
                return pose.sum();
            }
            let ids = &ids[..count];
            let path = projector.path(&self.scene.batch(ids));
            let [x, y, d1, l, d2, depth, compensation, radius] = load::<L, PROJECTED>(&gather(self.v_projected, ids));
            let v = ProjectedRow { mean: [x, y], conic: [d1, l, d2], depth, compensation, radius };
            let gradient = projector.vjp(&path, v);
            // Lanes behind the last id have a zero quaternion, whose norm is zero: not valid.
            let kept = L::bits(gradient.valid) & (u16::MAX >> (LANES - count));
            scatter(gradient.means, ids, self.first, kept, self.means);
            scatter(gradient.quats, ids, self.first, kept, self.quats);
            scatter(gradient.log_scales, ids, self.first, kept, self.log_scales);
            pose.add_where(gradient.valid, &gradient.pose);
        }
    }
}

struct BatchGradient<L: Lanes> {
    means: Vec3<Wide<L>>,
    quats: [Wide<L>; 4],
    log_scales: Vec3<Wide<L>>,
    pose: PoseGradient<Wide<L>>,
    valid: L::Mask,
}

impl<L: Lanes> Projector<L> {
    /// Gradients by the parameters and the pose from `v`, the gradient by the rows.
    #[inline(always)]
    fn vjp(&self, path: &Path<L>, v: ProjectedRow<Wide<L>>) -> BatchGradient<L> {
        let v_compensation = self.antialiased.then_some(v.compensation);
        let ellipse =
            covariance::project_vjp(&path.rotation, path.scales, path.jacobian, &path.ellipse, v.conic, v_compensation);
        let p = path.p;
        let mut v_p = [Wide::of(0.0), Wide::of(0.0), v.depth];
        for k in 0..2 {
            let scale = self.pinhole.focal[k] / p[2];
            v_p[k] += v.mean[k] * scale;
            v_p[2] -= v.mean[k] * scale * (p[k] / p[2]);
        }
        let mut pose = PoseGradient::zero();
        self.pinhole.jacobian_vjp(p, &self.pose.rotation, ellipse.a, &mut v_p, &mut pose.rotation);
        pose.translation = v_p;
        for i in 0..3 {
            for j in 0..3 {
                pose.rotation[i][j] += v_p[i] * path.mean[j];
            }
        }
        let means = mat_t_vec(&self.pose.rotation, v_p);
        let quats = normalise_vjp(path.unit_quat, path.quat_norm, rotation_vjp(path.unit_quat, &ellipse.rotation));
        let log_scales = ellipse.log_scales;
        let mut valid = path.valid;
        for x in means {
            valid = L::both(valid, x.is_finite());
        }
        for x in quats {
            valid = L::both(valid, x.is_finite());
        }
        for x in log_scales {
            valid = L::both(valid, x.is_finite());
        }
        for i in 0..3 {
            valid = L::both(valid, pose.translation[i].is_finite());
            for x in pose.rotation[i] {
                valid = L::both(valid, x.is_finite());
            }
        }
        BatchGradient { means, quats, log_scales, pose, valid }
    }
}
