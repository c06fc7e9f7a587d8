//! Gaussians under the transform of their node.
//!
//! A linear map `M` turns a covariance `C C^T` with `C = R(q) diag(s)` into `M C C^T M^T`: the new axes and sizes are
//! the left singular vectors and singular values of `M C`. Harmonics are turned by the rotation in `M`, as the
//! extension wants.

use glam::{DMat3, DMat4, DQuat, DVec3};
use gs_base::polar::orthogonal;

use super::primitive::SIZE_LEAST;
use crate::sh_rotation::BandTurn;
use crate::splats::unit;
use crate::turn::{carry, quaternion, shift_motion, turn_quaternion, turn_vector, turned_law};
use crate::{Law, Motion, Splats};

/// A map is a rotation and one scale up to this difference of an entry: quaternions and matrices are written with seven
/// digits.
const SIMILAR: f64 = 1e-5;

/// Rounds of Jacobi's method; it converges quadratically, and five reach rounding.
const ROUNDS: usize = 12;

/// A place in the world that Gaussians can be brought to.
pub(super) struct Place {
    linear: DMat3,
    translation: DVec3,
    /// The nearest orthogonal map, which may be a reflection.
    turn: DMat3,
    scale: f64,
    is_similarity: bool,
}

impl Place {
    /// The place of a node.
    pub fn of(to_world: &DMat4) -> Result<Self, String> {
        let linear = DMat3::from_mat4(*to_world);
        let scale = linear.determinant().abs().cbrt();
        // A map whose smallest size is a millionth of its mean one leaves nothing to draw.
        let turn = (scale > 0.0 && scale.is_finite()).then(|| orthogonal(linear * (1.0 / scale))).flatten();
        let turn = turn.ok_or_else(|| format!("expected a transform with three sizes, found {linear}"))?;
        let difference = linear * (1.0 / scale) - turn;
        let is_similarity = difference.to_cols_array().iter().all(|x| x.abs() < SIMILAR);
        Ok(Self { linear, translation: to_world.w_axis.truncate(), turn, scale, is_similarity })
    }

    fn is_identity(&self) -> bool {
        self.linear == DMat3::IDENTITY
    }

    /// The vector to be added to [`positions`](Self::positions) of Gaussians with an `offset`.
    pub fn shift(&self, offset: [f64; 3]) -> DVec3 {
        self.linear * DVec3::from_array(offset) + self.translation
    }

    /// The means, turned and scaled and not yet moved.
    pub fn positions<'a>(&'a self, splats: &'a Splats) -> impl Iterator<Item = DVec3> + 'a {
        splats.means.iter().map(|mean| self.linear * DVec3::from_array(mean.map(f64::from)))
    }

    /// All but the means.
    pub fn shape(&self, splats: &mut Splats) {
        if self.is_identity() {
            return;
        }
        let bands = BandTurn::new(self.turn);
        let s = splats.coefficients();
        splats.sh.chunks_mut(s).for_each(|sh| bands.turn(sh));
        if self.is_similarity {
            let (quat, larger) = (self.quaternion(), self.scale.ln() as f32);
            splats.quats.iter_mut().filter(|q| **q != [0.0; 4]).for_each(|q| *q = turn_quaternion(quat, *q));
            splats.log_scales.iter_mut().flatten().for_each(|s| *s += larger);
            return;
        }
        for (q, log_scales) in splats.quats.iter_mut().zip(&mut splats.log_scales).filter(|(q, _)| **q != [0.0; 4]) {
            let [w, x, y, z] = unit(*q);
            let sizes = DVec3::from_array(log_scales.map(|s| f64::from(s).exp()));
            let shape = self.linear * DMat3::from_quat(DQuat::from_xyzw(x, y, z, w)) * DMat3::from_diagonal(sizes);
            let (axes, sizes) = axes_and_sizes(shape);
            let quat = quaternion(axes);
            *q = [quat.w, quat.x, quat.y, quat.z].map(|x| x as f32);
            *log_scales = sizes.to_array().map(|size| size.max(f64::from(SIZE_LEAST)).ln() as f32);
        }
    }

    /// A motion, whose key frames are moved by `shift`.
    pub fn motion(&self, motion: &Motion, shift: DVec3) -> Result<Motion, String> {
        if !self.is_similarity {
            return Err("expected one scale in the transform of Gaussians that move, found several".into());
        }
        // A rotation vector keeps its direction where a mirror reverses others.
        let sign = self.turn.determinant().signum();
        let quat = self.quaternion();
        let mut motion = turned_law(
            motion,
            |v| turn_vector(self.linear, v),
            |q| if self.is_identity() { q } else { turn_quaternion(quat, q) },
        );
        match &mut motion.law {
            Law::Series(law) => {
                let own = (sign / self.scale) as f32;
                law.rotation.vectors.iter_mut().flatten().for_each(|x| *x *= own);
                carry(&mut motion, self.linear, DVec3::ZERO, self.linear * f64::from(own));
            }
            Law::Keys(keys) => {
                keys.log_scales.iter_mut().flatten().for_each(|s| *s += self.scale.ln() as f32);
            }
        }
        shift_motion(&mut motion, shift);
        Ok(motion)
    }

    /// The turn of axes: an axis and its opposite are one, so a reflection is as good as its negative, which is a
    /// rotation.
    fn quaternion(&self) -> DQuat {
        quaternion(self.turn * self.turn.determinant().signum())
    }
}

/// Orthonormal axes of positive determinant and the sizes along them, of `shape shape^T`: Jacobi's method on the
/// columns, which keeps the digits of needles.
fn axes_and_sizes(mut shape: DMat3) -> (DMat3, DVec3) {
    for _ in 0..ROUNDS {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let (a, b) = (shape.col(p), shape.col(q));
            let mixed = a.dot(b);
            if mixed == 0.0 {
                continue;
            }
            let ratio = (b.length_squared() - a.length_squared()) / (2.0 * mixed);
            let t = ratio.signum() / (ratio.abs() + (1.0 + ratio * ratio).sqrt());
            let c = 1.0 / (1.0 + t * t).sqrt();
            *shape.col_mut(p) = c * (a - t * b);
            *shape.col_mut(q) = c * (b + t * a);
        }
    }
    let sizes = DVec3::from_array([0, 1, 2].map(|i| shape.col(i).length()));
    // The shortest axis follows from the others, since it may have no length.
    let mut order = [0, 1, 2];
    order.sort_by(|i, j| sizes[*j].total_cmp(&sizes[*i]));
    let longest = shape.col(order[0]).try_normalize().unwrap_or(DVec3::X);
    let middle = shape.col(order[1]).reject_from_normalized(longest);
    let middle = middle.try_normalize().unwrap_or_else(|| longest.any_orthonormal_vector());
    let axes = DMat3::from_cols(longest, middle, longest.cross(middle));
    (axes, DVec3::new(sizes[order[0]], sizes[order[1]], sizes[order[2]]))
}
