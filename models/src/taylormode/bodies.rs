//! Motion of bodies: what many Gaussians have in common is stored once. Not part of the paper, in which each Gaussian
//! moves on its own.
//!
//! Near the centre of a body its motion is the first order of a Taylor series in space, for each block of a path
//!
//! `b_k(x) = W_k [1, (x - centre) / scale]`,   `W_k` `[3, 4]`,
//!
//! which holds every rigid motion exactly (a rotation by any angle is linear in `x`) and much else approximately.
//! Blocks of a member above its own order are those of its body; a member of order 0 stores nothing but the number of
//! its body.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};
use gs_base::dense::solve_columns;
use gs_base::polar::orthogonal;
use gs_burn::exact_matmul;
use gs_burn::glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::window::polynomials;
use crate::rotation::nearest;

/// The body of a row that belongs to none: its blocks above its own order are zero.
pub const NO_BODY: u8 = u8::MAX;

/// Unit of positions, in root mean square extents of the body: nearly all of it lies within, so that a position adds
/// less than 1 per axis.
const REACH: f64 = 2.0;

/// Square of the distance from the centre, in units of positions, beyond which a Gaussian has strayed and follows the
/// shift alone: the ball around the cube of one unit per axis.
const STRAYED: f64 = 3.0;

/// Where a body is; as JSON to the bit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BodyFrame {
    /// Centre of the positions, scene units.
    #[serde(with = "crate::bits")]
    pub centre: [f64; 3],
    /// Unit of the positions, scene units.
    #[serde(with = "crate::bits")]
    pub scale: f64,
    /// The highest order of its paths.
    pub order: u8,
}

impl BodyFrame {
    /// A body at rest with its centre and root mean square extent, scene units.
    pub fn new(centre: [f64; 3], extent: f64) -> Self {
        Self { centre, scale: REACH * extent, order: 0 }
    }

    /// `[1, (x - centre) / scale]` at `positions` `[M, 3]`, `[M, 4]`.
    pub fn basis(&self, positions: &Tensor<2>) -> Tensor<2> {
        let options = (&positions.device(), positions.dtype());
        let centre: Tensor<2> = Tensor::<1>::from_data(self.centre, options).unsqueeze();
        let offset = (positions.clone() - centre) / self.scale;
        let belongs =
            offset.clone().powi_scalar(2).sum_dim(1).lower_equal_elem(STRAYED).float().cast(positions.dtype());
        Tensor::cat(vec![Tensor::ones([positions.dims()[0], 1], options), offset * belongs], 1)
    }

    /// The same of one position, on the host.
    pub fn basis_at(&self, position: &[f32]) -> [f64; 4] {
        let [x, y, z] = self.offset(position);
        let belongs = if self.carries(position) { 1.0 } else { 0.0 };
        [1.0, belongs * x, belongs * y, belongs * z]
    }

    /// Whether a position turns with the body; one that has strayed follows the shift alone.
    pub fn carries(&self, position: &[f32]) -> bool {
        self.offset(position).iter().map(|x| x * x).sum::<f64>() <= STRAYED
    }

    fn offset(&self, position: &[f32]) -> [f64; 3] {
        [0, 1, 2].map(|axis| (f64::from(position[axis]) - self.centre[axis]) / self.scale)
    }
}

/// A body and its motion.
#[derive(Module, Debug)]
pub struct Body {
    /// `[4, 3 (K + J)]`: `W_k` transposed, first of the polynomials, then of the contacts; scene units.
    pub blocks: Param<Tensor<2>>,
    /// `[1, 3 Kr]`, the turn of the body in the blocks of a rotation, radians.
    pub turn: Param<Tensor<2>>,
    /// Where it is.
    #[module(skip)]
    pub frame: BodyFrame,
}

impl Body {
    /// A body at rest with room for `blocks` and for the turns of `rotation_order`.
    pub fn new(frame: BodyFrame, blocks: usize, rotation_order: usize, device: &Device) -> Self {
        let zeros = |rows, blocks| Param::from_tensor(Tensor::zeros([rows, 3 * blocks], device));
        Self { blocks: zeros(4, blocks), turn: zeros(1, rotation_order), frame }
    }

    /// The body with the turn that its blocks say; reads them back from the device.
    pub fn turned(mut self) -> Self {
        let columns = self.blocks.dims()[1];
        let values: Vec<f32> = self.blocks.val().to_data().iter::<f32>().collect();
        let vector = |row: usize, k: usize| {
            DVec3::from([0, 1, 2].map(|axis| f64::from(values[row * columns + 3 * k + axis]))) / self.frame.scale
        };
        let linear: Vec<[DVec3; 3]> =
            (0..usize::from(self.frame.order)).map(|k| [1, 2, 3].map(|row| vector(row, k))).collect();
        let turn: Vec<f64> = turn_of(&linear, self.turn.dims()[1] / 3);
        self.turn = self.turn.map(|turn_before| {
            let data = TensorData::new(turn, turn_before.dims());
            Tensor::from_data(data, (&turn_before.device(), turn_before.dtype()))
        });
        self
    }

    /// The blocks of rows whose basis is `basis` `[M, 4]`, `[M, 3 (K + J)]`.
    pub fn carried(&self, basis: Tensor<2>) -> Tensor<2> {
        exact_matmul(basis, self.blocks.val())
    }
}

/// Times on each side of `t0` at which a turn is evaluated, for each of its orders.
const TURN_SAMPLES: usize = 8;

/// The turn of a body in `order` blocks of the rotation vector, `[3 * order]`: the least squares fit over the window to
/// the rotation nearest to its linear part. `linear[k]` is `W_k` without its first column, over the scale: by column,
/// the change of position per scene unit along x, y and z.
pub fn turn_of(linear: &[[DVec3; 3]], order: usize) -> Vec<f64> {
    if order == 0 || linear.is_empty() {
        return vec![0.0; 3 * order];
    }
    let count = TURN_SAMPLES * order;
    let mut normal = vec![vec![0.0; order + 3]; order];
    for side in [-1.0, 1.0] {
        let mut before = DVec3::ZERO;
        for sample in 1..=count {
            let s = side * sample as f64 / count as f64;
            let values: Vec<f64> = polynomials(s, linear.len().max(order)).iter().map(|sample| sample.value).collect();
            let mut columns = [DVec3::X, DVec3::Y, DVec3::Z];
            for (value, own) in values.iter().zip(linear) {
                columns.iter_mut().zip(own).for_each(|(column, own)| *column += *value * *own);
            }
            let Some(rotation) = nearest_rotation(DMat3::from_cols(columns[0], columns[1], columns[2])) else {
                return vec![0.0; 3 * order];
            };
            before = nearest(rotation, before);
            for (row, equation) in normal.iter_mut().enumerate() {
                let known = values[..order].iter().copied().chain(before.to_array());
                equation.iter_mut().zip(known).for_each(|(entry, x)| *entry += values[row] * x);
            }
        }
    }
    solve_columns::<3>(normal).into_iter().flatten().collect()
}

/// The rotation of the polar decomposition of a matrix; `None` where it mirrors or is singular.
fn nearest_rotation(matrix: DMat3) -> Option<DQuat> {
    let rotation = orthogonal(matrix).filter(|rotation| rotation.determinant() > 0.0);
    rotation.map(|rotation| DQuat::from_mat3(&rotation))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::taylormode::window::powers_of;

    /// A body that turns by 2.4 radians a half window about a tilted axis: cosines and sines by Taylor's series.
    #[test]
    fn a_turn_comes_out_of_the_linear_part() {
        const ORDER: usize = 12;
        let (axis, angle) = (DVec3::new(0.6, 0.0, 0.8), 2.4);
        let cross = |v: DVec3| axis.cross(v);
        // exp(angle s [axis]) = sum_k (angle s)^k [axis]^k / k!, by power, then by the polynomials' factors.
        let powers = powers_of(ORDER);
        let mut by_power = vec![[DVec3::ZERO; 3]; ORDER];
        let mut term = [DVec3::X, DVec3::Y, DVec3::Z];
        for (k, own) in by_power.iter_mut().enumerate() {
            term = term.map(|v| cross(v) * angle / (k + 1) as f64);
            *own = term;
        }
        let mut linear = vec![[DVec3::ZERO; 3]; ORDER];
        for k in (0..ORDER).rev() {
            let lead = powers[k][k];
            linear[k] = by_power[k].map(|v| v / lead);
            for (power, factor) in powers[k].iter().enumerate() {
                let own = linear[k];
                by_power[power].iter_mut().zip(own).for_each(|(rest, v)| *rest -= *factor * v);
            }
        }
        let turn = turn_of(&linear, 2);
        let expected = axis * angle;
        let found = DVec3::from_slice(&turn[..3]);
        assert!((found - expected).length() < 2e-3 && turn[3..].iter().all(|x| x.abs() < 2e-3), "{turn:?}");
    }

    #[test]
    fn a_mirror_has_no_turn() {
        let mirrored = [DVec3::new(-2.0, 0.0, 0.0), DVec3::ZERO, DVec3::ZERO];
        assert_eq!(turn_of(&[mirrored], 1), [0.0; 3]);
    }
}
