//! Sixteen Gaussians at once: from rows to one array per component, and back.

use crate::config::ProjectionConfig;
use crate::cpu::camera::{Pinhole, Pose};
use crate::cpu::real::{LANES, Lanes, Number, Real};
use crate::cpu::wide::Wide;

/// Number of values of a Gaussian's mean, orientation and scale.
pub(super) const MEAN: usize = 3;
pub(super) const QUAT: usize = 4;
pub(super) const SCALES: usize = 3;

/// Parameters of sixteen Gaussians, one array per component.
pub(super) struct Batch<F> {
    pub(super) means: [[F; LANES]; MEAN],
    pub(super) quats: [[F; LANES]; QUAT],
    pub(super) scales: [[F; LANES]; SCALES],
}

/// All Gaussians and the camera.
pub(super) struct Scene<'a, F> {
    pub(super) means: &'a [F],
    pub(super) quats: &'a [F],
    pub(super) log_scales: &'a [F],
    pub(super) pose: Pose<F>,
    pub(super) pinhole: Pinhole<F>,
    pub(super) near: F,
    pub(super) far: F,
    pub(super) eps2d: F,
    pub(super) size: [F; 2],
    pub(super) antialiased: bool,
}

/// Component `c` of the rows `ids` of a packed list of `K`-vectors, for each `c`; lanes behind the last id hold zero.
#[inline(always)]
pub(super) fn gather<F: Real, const K: usize>(values: &[F], ids: &[u32]) -> [[F; LANES]; K] {
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
pub(super) fn scatter<L: Lanes, const K: usize>(
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
pub(super) fn load<L: Lanes, const K: usize>(columns: &[[L::Real; LANES]; K]) -> [Wide<L>; K] {
    let mut lanes = [Wide::of(0.0); K];
    for c in 0..K {
        lanes[c] = Wide::load(&columns[c]);
    }
    lanes
}

impl<'a, F: Real> Scene<'a, F> {
    pub(super) fn new(
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
    pub(super) fn batch(&self, ids: &[u32]) -> Batch<F> {
        let mut scales = gather::<F, SCALES>(self.log_scales, ids);
        for column in &mut scales {
            for scale in column {
                *scale = scale.exp();
            }
        }
        Batch { means: gather(self.means, ids), quats: gather(self.quats, ids), scales }
    }
}
