//! 3D Gaussians to 2D ellipses (EWA), forward and backward; sixteen Gaussians at once, in fixed chunks over threads.

use rayon::prelude::*;

use crate::config::ProjectionConfig;
use crate::constants::{CUTOFF_SIGMAS, QUAT_NORM2_MAX, QUAT_NORM2_MIN};
use crate::cpu::camera::{Pinhole, Pose, PoseGradient};
use crate::cpu::covariance::{self, Projected2d};
use crate::cpu::lanes::{LANES, Lanes};
use crate::cpu::math::{Mat3, Vec3, mat_t_vec, normalise_vjp, rotation, rotation_vjp};
use crate::cpu::parallel::{CHUNK, zeros};
use crate::cpu::real::{LaneTask, Real};
use crate::cpu::wide::{Number, Wide};
use crate::rows::{PROJECTED, ProjectedRow};

/// Numbers of a Gaussian's centre, orientation and size.
const MEAN: usize = 3;
const QUAT: usize = 4;
const SCALES: usize = 3;

/// Parameters of sixteen Gaussians, one array a component.
struct Batch<F> {
    means: [[F; LANES]; MEAN],
    quats: [[F; LANES]; QUAT],
    scales: [[F; LANES]; SCALES],
}

/// All Gaussians and the camera.
struct Scene<'a, F> {
    means: &'a [F],
    quats: &'a [F],
    log_scales: &'a [F],
    pose: Pose<F>,
    pinhole: Pinhole<F>,
    near: F,
    far: F,
    eps2d: F,
    size: [F; 2],
    antialiased: bool,
}

/// Component `c` of the rows `ids` of a packed list of `K`-vectors, for each `c`; lanes behind the last id hold zero.
#[inline(always)]
fn gather<F: Real, const K: usize>(values: &[F], ids: &[u32]) -> [[F; LANES]; K] {
    let mut out = [[F::ZERO; LANES]; K];
    for (lane, &id) in ids.iter().enumerate().take(LANES) {
        let row = &values[id as usize * K..][..K];
        for c in 0..K {
            out[c][lane] = row[c];
        }
    }
    out
}

/// The opposite of [`gather`], for lanes whose bit is set; row `id - first` of `values` belongs to Gaussian `id`.
#[inline(always)]
fn scatter<L: Lanes, const K: usize>(
    lanes: [Wide<L>; K],
    ids: &[u32],
    first: usize,
    kept: u16,
    values: &mut [L::Real],
) {
    let mut columns = [[L::Real::ZERO; LANES]; K];
    for c in 0..K {
        lanes[c].0.store(&mut columns[c]);
    }
    for (lane, &id) in ids.iter().enumerate().take(LANES) {
        if kept >> lane & 1 != 0 {
            let row = &mut values[(id as usize - first) * K..][..K];
            for c in 0..K {
                row[c] = columns[c][lane];
            }
        }
    }
}

/// As vectors.
#[inline(always)]
fn load<L: Lanes, const K: usize>(columns: &[[L::Real; LANES]; K]) -> [Wide<L>; K] {
    let mut lanes = [Wide::of(0.0); K];
    for c in 0..K {
        lanes[c] = Wide::load(&columns[c]);
    }
    lanes
}

impl<'a, F: Real> Scene<'a, F> {
    fn new(
        means: &'a [F],
        quats: &'a [F],
        log_scales: &'a [F],
        viewmat: &[F],
        config: &ProjectionConfig,
    ) -> (Self, usize) {
        let count = means.len() / MEAN;
        assert_eq!(means.len(), count * MEAN, "means must be [N, 3]");
        assert_eq!(quats.len(), count * QUAT, "quats must be [N, 4] for {count} means");
        assert_eq!(log_scales.len(), count * SCALES, "log_scales must be [N, 3] for {count} means");
        let scene = Self {
            means,
            quats,
            log_scales,
            pose: Pose::read(viewmat),
            pinhole: Pinhole::new(config),
            near: F::of(config.near),
            far: F::of(config.far),
            eps2d: F::of(config.eps2d),
            size: [F::of(config.width.into()), F::of(config.height.into())],
            antialiased: config.antialiased,
        };
        (scene, count)
    }

    /// The Gaussians `ids`, at most sixteen.
    #[inline(always)]
    fn batch(&self, ids: &[u32]) -> Batch<F> {
        let mut scales = gather::<F, SCALES>(self.log_scales, ids);
        for column in &mut scales {
            for scale in column {
                *scale = scale.exp();
            }
        }
        Batch { means: gather(self.means, ids), quats: gather(self.quats, ids), scales }
    }
}

/// What a [`Scene`] holds, for sixteen Gaussians.
struct Projector<L: Lanes> {
    pose: Pose<Wide<L>>,
    pinhole: Pinhole<Wide<L>>,
    near: Wide<L>,
    far: Wide<L>,
    eps2d: Wide<L>,
    size: [Wide<L>; 2],
    antialiased: bool,
}

/// What Gaussians go through, made again by the backward pass with the same roundings.
struct Path<L: Lanes> {
    mean: Vec3<Wide<L>>,
    unit_quat: [Wide<L>; 4],
    quat_norm: Wide<L>,
    rotation: Mat3<Wide<L>>,
    scales: Vec3<Wide<L>>,
    p: Vec3<Wide<L>>,
    jacobian: [Vec3<Wide<L>>; 2],
    ellipse: Projected2d<L>,
    /// Which can be drawn. The rest may hold anything.
    valid: L::Mask,
}

impl<L: Lanes> Projector<L> {
    #[inline(always)]
    fn new(scene: &Scene<'_, L::Real>) -> Self {
        Self {
            pose: scene.pose.wide(),
            pinhole: scene.pinhole.wide(),
            near: Wide::splat(scene.near),
            far: Wide::splat(scene.far),
            eps2d: Wide::splat(scene.eps2d),
            size: [Wide::splat(scene.size[0]), Wide::splat(scene.size[1])],
            antialiased: scene.antialiased,
        }
    }

    #[inline(always)]
    fn path(&self, batch: &Batch<L::Real>) -> Path<L> {
        let (mean, quat, scales) =
            (load::<L, MEAN>(&batch.means), load::<L, QUAT>(&batch.quats), load::<L, SCALES>(&batch.scales));
        let p = self.pose.apply(mean);
        let norm2 = quat[0] * quat[0] + quat[1] * quat[1] + quat[2] * quat[2] + quat[3] * quat[3];
        let quat_norm = norm2.sqrt();
        let unit_quat = [quat[0] / quat_norm, quat[1] / quat_norm, quat[2] / quat_norm, quat[3] / quat_norm];
        let rotation = rotation(unit_quat);
        let jacobian = self.pinhole.jacobian(p, &self.pose.rotation);
        let ellipse = covariance::project(&rotation, scales, jacobian, self.eps2d);
        let turned = norm2.within(Wide::of(QUAT_NORM2_MIN), Wide::of(QUAT_NORM2_MAX));
        let valid = L::both(L::both(p[2].within(self.near, self.far), turned), ellipse.drawable());
        Path { mean, unit_quat, quat_norm, rotation, scales, p, jacobian, ellipse, valid }
    }

    /// Packed rows by column, and which are drawn: those whose ellipse meets the image and does not overflow.
    #[inline(always)]
    fn rows(&self, path: &Path<L>) -> ([Wide<L>; PROJECTED], u16) {
        let mut valid = path.valid;
        let (mut mean, mut reach) = ([Wide::of(0.0); 2], [Wide::of(0.0); 2]);
        for k in 0..2 {
            mean[k] = self.pinhole.focal[k] * (path.p[k] / path.p[2]) + self.pinhole.principal[k];
            reach[k] = Wide::of(CUTOFF_SIGMAS) * path.ellipse.cov[2 * k].sqrt();
            let seen = L::both((mean[k] + reach[k]).above(Wide::of(0.0)), self.size[k].above(mean[k] - reach[k]));
            valid = L::both(valid, seen);
        }
        let row = ProjectedRow {
            mean,
            conic: path.ellipse.conic,
            depth: path.p[2],
            compensation: if self.antialiased { path.ellipse.compensation() } else { Wide::of(1.0) },
            radius: reach[0].max(reach[1]),
        }
        .pack();
        for column in row {
            valid = L::both(valid, column.is_finite());
        }
        (row, L::bits(valid))
    }

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

struct BatchGradient<L: Lanes> {
    means: Vec3<Wide<L>>,
    quats: [Wide<L>; 4],
    log_scales: Vec3<Wide<L>>,
    pose: PoseGradient<Wide<L>>,
    valid: L::Mask,
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
    let (scene, count) = Scene::new(means, quats, log_scales, viewmat, config);
    let mut rows = zeros(count * PROJECTED);
    rows.par_chunks_mut(CHUNK * PROJECTED).enumerate().for_each(|(chunk, rows)| {
        F::with_lanes(ChunkForward { scene: &scene, first: chunk * CHUNK, rows });
    });
    rows
}

/// Gaussians from `first` on, as many as `rows` holds.
struct ChunkForward<'a, F> {
    scene: &'a Scene<'a, F>,
    first: usize,
    rows: &'a mut [F],
}

impl<F: Real> LaneTask<F> for ChunkForward<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes<Real = F>>(self) {
        let projector = Projector::<L>::new(self.scene);
        let end = self.first + self.rows.len() / PROJECTED;
        let mut ids = [0_u32; LANES];
        for begin in (self.first..end).step_by(LANES) {
            let count = LANES.min(end - begin);
            for (lane, id) in ids.iter_mut().enumerate() {
                *id = (begin + lane) as u32;
            }
            let ids = &ids[..count];
            let (row, drawn) = projector.rows(&projector.path(&self.scene.batch(ids)));
            scatter(row, ids, self.first, drawn & (u16::MAX >> (LANES - count)), self.rows);
        }
    }
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
struct ChunkBackward<'a, F> {
    scene: &'a Scene<'a, F>,
    first: usize,
    projected: &'a [F],
    v_projected: &'a [F],
    means: &'a mut [F],
    quats: &'a mut [F],
    log_scales: &'a mut [F],
}

impl<F: Real> LaneTask<F> for ChunkBackward<'_, F> {
    /// The chunk's share of the pose's gradient.
    type Output = PoseGradient<F>;

    #[inline(always)]
    fn run<L: Lanes<Real = F>>(self) -> PoseGradient<F> {
        let projector = Projector::<L>::new(self.scene);
        let mut pose = PoseGradient::zero();
        let end = self.first + self.means.len() / MEAN;
        let mut next = self.first;
        loop {
            // Lanes are filled with the next Gaussians that are drawn and receive anything: a trained scene has many
            // hidden behind others, and all that follows is linear in v.
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
            // Lanes behind the last id are those of a Gaussian without size or place, whose norm is zero: not valid.
            let kept = L::bits(gradient.valid) & (u16::MAX >> (LANES - count));
            scatter(gradient.means, ids, self.first, kept, self.means);
            scatter(gradient.quats, ids, self.first, kept, self.quats);
            scatter(gradient.log_scales, ids, self.first, kept, self.log_scales);
            pose.add_where(gradient.valid, &gradient.pose);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::lanes::Portable;

    /// Numbers in -1..1, some of them what nothing can be made of.
    fn strange(count: usize, seed: u32) -> Vec<f32> {
        let number = |i: u32| match i.wrapping_mul(2_654_435_761).wrapping_add(seed) >> 16 {
            0..64 => f32::NAN,
            64..128 => f32::INFINITY,
            128..192 => 1e30,
            192..256 => 0.0,
            other => f32::from(other as u16) / 32_768.0 - 1.0,
        };
        (0..count as u32).map(number).collect()
    }

    #[test]
    fn every_vector_unit_gives_the_same_bits() {
        let count = 1000;
        let (mut means, quats, log_scales) = (strange(3 * count, 1), strange(4 * count, 2), strange(3 * count, 3));
        means.iter_mut().skip(2).step_by(3).for_each(|z| *z += 1.5);
        let viewmat: Vec<f32> = (0..16).map(|i| if i % 5 == 0 { 1.0 } else { 0.01 * i as f32 }).collect();
        let config = ProjectionConfig {
            width: 60,
            height: 40,
            fx: 50.0,
            fy: 55.0,
            cx: 31.0,
            cy: 19.0,
            antialiased: true,
            ..Default::default()
        };
        let (scene, _) = Scene::new(&means, &quats, &log_scales, &viewmat, &config);
        let bits = |values: &[f32]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let (mut rows, mut portable) = (vec![0.0; count * PROJECTED], vec![0.0; count * PROJECTED]);
        f32::with_lanes(ChunkForward { scene: &scene, first: 0, rows: &mut rows });
        ChunkForward { scene: &scene, first: 0, rows: &mut portable }.run::<Portable<f32>>();
        assert!(rows.chunks(PROJECTED).filter(|row| row[7] > 0.0).count() > count / 2);
        assert!(bits(&rows) == bits(&portable), "rows");

        let v: Vec<f32> = (0..count * PROJECTED).map(|i| (i % 13) as f32 - 6.0).collect();
        let mut gradients = [(); 2].map(|()| (vec![0.0; 3 * count], vec![0.0; 4 * count], vec![0.0; 3 * count]));
        let [poses_lanes, poses_portable] = {
            let [first, second] = &mut gradients;
            let task = |to: &mut (Vec<f32>, Vec<f32>, Vec<f32>), best: bool| {
                let (means, quats, log_scales) = (&mut to.0[..], &mut to.1[..], &mut to.2[..]);
                let (scene, projected, v_projected) = (&scene, &rows[..], &v[..]);
                let task = ChunkBackward { scene, first: 0, projected, v_projected, means, quats, log_scales };
                if best { f32::with_lanes(task) } else { task.run::<Portable<f32>>() }
            };
            [task(first, true), task(second, false)]
        };
        let [lanes, portable] = &gradients;
        assert!(lanes.0.iter().any(|g| *g != 0.0));
        assert!(bits(&lanes.0) == bits(&portable.0), "means");
        assert!(bits(&lanes.1) == bits(&portable.1), "quats");
        assert!(bits(&lanes.2) == bits(&portable.2), "log_scales");
        assert!(bits(&poses_lanes.into_viewmat()) == bits(&poses_portable.into_viewmat()), "viewmat");
    }
}
