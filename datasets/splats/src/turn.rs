//! Turning a world: exactly by 180 degrees about x, or by any rotation.

use glam::{DMat3, DQuat, DVec3};

use crate::sh_rotation::BandTurn;
use crate::splats::unit;
use crate::{Law, Motion, SeriesLaw, Splats};

/// Signs of the 16 harmonics when y and z are reversed.
pub(crate) const FLIPPED_SH: [f32; 16] =
    [1.0, -1.0, -1.0, 1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0];

/// Turned by 180 degrees about x: from y down to y up, and back. To the bit: only signs change.
pub fn flip(splats: &Splats) -> Splats {
    let (mut flipped, s) = (splats.clone(), splats.coefficients());
    flipped.means.iter_mut().for_each(|mean| *mean = flip_vector(*mean));
    flipped.offset = flip_offset(splats.offset);
    // The Gaussian's own axes y and z are reversed with the world's, which its shape does not see.
    flipped.quats.iter_mut().for_each(|q| *q = flip_quaternion(*q));
    flipped.sh.iter_mut().enumerate().for_each(|(i, c)| *c = c.map(|c| FLIPPED_SH[i % s] * c));
    flipped
}

/// [`flip`] of a motion.
pub fn flip_motion(motion: &Motion) -> Motion {
    let mut flipped = turned_law(motion, flip_vector, flip_quaternion);
    let half = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
    carry(&mut flipped, half, DVec3::ZERO, half);
    flipped
}

fn flip_vector([x, y, z]: [f32; 3]) -> [f32; 3] {
    [x, -y, -z]
}

fn flip_quaternion([w, x, y, z]: [f32; 4]) -> [f32; 4] {
    [w, x, -y, -z]
}

fn flip_offset([x, y, z]: [f64; 3]) -> [f64; 3] {
    // Not -0, which would be written as such.
    [x, 0.0 - y, 0.0 - z]
}

/// Turned by any rotation: means, orientations and harmonics. A Gaussian that was at `p` is at `rotation p`, and looks
/// from there as it looked.
pub fn turn(splats: &Splats, rotation: DMat3) -> Splats {
    let (quat, bands) = (quaternion(rotation), BandTurn::new(rotation));
    let (mut turned, s) = (splats.clone(), splats.coefficients());
    turned.means.iter_mut().for_each(|mean| *mean = turn_vector(rotation, *mean));
    turned.offset = (rotation * DVec3::from_array(splats.offset)).to_array();
    turned.quats.iter_mut().for_each(|q| *q = turn_quaternion(quat, *q));
    turned.sh.chunks_mut(s).for_each(|sh| bands.turn(sh));
    turned
}

/// [`turn`] of a motion.
pub fn turn_motion(motion: &Motion, rotation: DMat3) -> Motion {
    let quat = quaternion(rotation);
    let mut turned = turned_law(motion, |v| turn_vector(rotation, v), |q| turn_quaternion(quat, q));
    carry(&mut turned, rotation, DVec3::ZERO, rotation);
    turned
}

/// Moves a motion by `shift`, as the means that it is beside: key frames and the places of bodies.
pub fn shift_motion(motion: &mut Motion, shift: DVec3) {
    if let Law::Keys(keys) = &mut motion.law {
        keys.means.iter_mut().for_each(|mean| *mean = moved(*mean, shift));
    }
    carry(motion, DMat3::IDENTITY, shift, DMat3::IDENTITY);
}

/// Moves what rows have in common along; see [`Carried::moved`](crate::Carried).
pub(crate) fn carry(motion: &mut Motion, linear: DMat3, shift: DVec3, turn: DMat3) {
    if let Law::Series(SeriesLaw { carried: Some(carried), .. }) = &mut motion.law {
        carried.moved(linear, shift, turn);
    }
}

/// The smallest rotation after which `up`, a direction of the world, is -y: up in the axes of [`Splats`].
/// `None` when `up` has no direction.
pub fn upright(up: DVec3) -> Option<DMat3> {
    let up = up.try_normalize()?;
    Some(DMat3::from_quat(DQuat::from_rotation_arc(up, DVec3::NEG_Y)))
}

pub(crate) fn turned_law(
    motion: &Motion,
    vector: impl Fn([f32; 3]) -> [f32; 3],
    quat: impl Fn([f32; 4]) -> [f32; 4],
) -> Motion {
    let mut motion = motion.clone();
    match &mut motion.law {
        // A rotation vector turns like any other vector.
        Law::Series(law) => {
            law.position.vectors.iter_mut().chain(&mut law.rotation.vectors).for_each(|v| *v = vector(*v));
        }
        Law::Keys(keys) => {
            keys.means.iter_mut().for_each(|v| *v = vector(*v));
            keys.quats.iter_mut().for_each(|q| *q = quat(*q));
        }
    }
    motion
}

pub(crate) fn quaternion(rotation: DMat3) -> DQuat {
    DQuat::from_mat3(&rotation).normalize()
}

pub(crate) fn turn_vector(rotation: DMat3, v: [f32; 3]) -> [f32; 3] {
    (rotation * DVec3::from_array(v.map(f64::from))).to_array().map(|x| x as f32)
}

/// A position moved by a vector.
pub fn moved(position: [f32; 3], by: DVec3) -> [f32; 3] {
    (DVec3::from_array(position.map(f64::from)) + by).to_array().map(|x| x as f32)
}

pub(crate) fn turn_quaternion(turn: DQuat, q: [f32; 4]) -> [f32; 4] {
    let [w, x, y, z] = unit(q);
    let q = turn * DQuat::from_xyzw(x, y, z, w);
    [q.w, q.x, q.y, q.z].map(|x| x as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::splats::testing::random;

    fn covariance(splats: &Splats, i: usize) -> DMat3 {
        let [w, x, y, z] = unit(splats.quats[i]);
        let axes = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w));
        let scales = DVec3::from_array(splats.log_scales[i].map(|s| f64::from(s).exp()));
        let m = axes * DMat3::from_diagonal(scales);
        m * m.transpose()
    }

    /// Covariances turn as `R C R^T`. Entries are at most exp(-4) and rounded at 6e-8 of them in the quaternion: below
    /// 1e-7.
    #[test]
    fn both_turns_turn_the_shapes() {
        let splats = random(10, 3, 1);
        let half = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        let other = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 1.1);
        for (rotation, turned) in [(half, flip(&splats)), (half, turn(&splats, half)), (other, turn(&splats, other))] {
            for i in 0..splats.len() {
                let expected = rotation * covariance(&splats, i) * rotation.transpose();
                let difference = expected - covariance(&turned, i);
                assert!(difference.to_cols_array().iter().all(|x| x.abs() < 1e-7), "{difference}");
            }
        }
        assert_eq!(flip(&flip(&splats)), splats);
    }

    #[test]
    fn up_becomes_minus_y() {
        for up in [DVec3::Z, DVec3::Y, DVec3::NEG_Y, DVec3::X, DVec3::new(0.1, -0.2, 3.0)] {
            let turned = upright(up).expect("a direction") * up.normalize();
            assert!((turned - DVec3::NEG_Y).length() < 1e-12, "{turned}");
        }
        assert_eq!(upright(DVec3::NEG_Y), Some(DMat3::IDENTITY));
        assert!(upright(DVec3::ZERO).is_none());
    }
}
