//! Means, scales and orientations to packed rows.

use rayon::prelude::*;

use super::batch::{Scene, scatter};
use super::path::{Path, Projector};
use crate::config::ProjectionConfig;
use crate::constants::CUTOFF_SIGMAS;
use crate::cpu::parallel::{CHUNK, zeros};
use crate::cpu::real::{LANES, LaneTask, Lanes, Number, Real};
use crate::cpu::wide::Wide;
use crate::rows::{PROJECTED, ProjectedRow};

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
pub(super) struct ChunkForward<'a, F> {
    pub(super) scene: &'a Scene<'a, F>,
    pub(super) first: usize,
    pub(super) rows: &'a mut [F],
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

impl<L: Lanes> Projector<L> {
    /// Packed rows by column, and a mask of those drawn: the ellipse meets the image and does not overflow.
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
}
