//! The steps of the projection that forward and backward share.

use super::batch::{Batch, MEAN, QUAT, SCALES, Scene, load};
use crate::constants::{QUAT_NORM2_MAX, QUAT_NORM2_MIN};
use crate::cpu::camera::{Pinhole, Pose};
use crate::cpu::covariance::{self, Projected2d};
use crate::cpu::math::{Mat3, Vec3, rotation};
use crate::cpu::real::{Lanes, Number};
use crate::cpu::wide::Wide;

/// The inputs of a [`Scene`], for sixteen Gaussians.
pub(super) struct Projector<L: Lanes> {
    pub(super) pose: Pose<Wide<L>>,
    pub(super) pinhole: Pinhole<Wide<L>>,
    pub(super) near: Wide<L>,
    pub(super) far: Wide<L>,
    pub(super) eps2d: Wide<L>,
    pub(super) size: [Wide<L>; 2],
    pub(super) antialiased: bool,
}

/// The intermediate results of the projection, recomputed by the backward pass with the same roundings.
pub(super) struct Path<L: Lanes> {
    pub(super) mean: Vec3<Wide<L>>,
    pub(super) unit_quat: [Wide<L>; 4],
    pub(super) quat_norm: Wide<L>,
    pub(super) rotation: Mat3<Wide<L>>,
    pub(super) scales: Vec3<Wide<L>>,
    pub(super) p: Vec3<Wide<L>>,
    pub(super) jacobian: [Vec3<Wide<L>>; 2],
    pub(super) ellipse: Projected2d<L>,
    /// Mask of lanes that can be drawn. The other lanes are arbitrary.
    pub(super) valid: L::Mask,
}

impl<L: Lanes> Projector<L> {
    #[inline(always)]
    pub(super) fn new(scene: &Scene<'_, L::Real>) -> Self {
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
    pub(super) fn path(&self, batch: &Batch<L::Real>) -> Path<L> {
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
}
