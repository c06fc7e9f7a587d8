//! Rigid motions of several bodies or nodes at one time, as rows.

use burn::tensor::{Int, Tensor, TensorData};

use super::basis::{EVEN, MOTION};
use crate::rotation::turn;
use crate::sparsedyn::state::State;
use crate::sparsedyn::turning::Factors;

/// Rotation vectors and shifts of centres, `[B, 3]` each.
pub(super) struct Turn {
    /// Radians.
    pub rotation: Tensor<2>,
    /// Scene units.
    pub shift: Tensor<2>,
}

/// Free motions at one time: each turns about its centre, first evenly, then by the spline, and shifts it.
///
/// The even rotation may be of many turns, the spline's stays small: a sum of the two vectors would be bent where it
/// passes a whole turn.
pub(super) struct Way {
    /// `[N, 3]` rotation vectors of the even part, radians.
    even: Tensor<2>,
    /// `[N, 3]` rotation vectors of the spline, which turns after it.
    spline: Tensor<2>,
    /// `[N, 3]`, scene units.
    pub shift: Tensor<2>,
    /// `[N, 3]` centres in the first frame, scene units.
    centres: Tensor<2>,
}

impl Way {
    /// Of `numbers` `[N, 6 P]` for values `basis` `[N, P]` of the functions of time; shifts are in units of `length`.
    pub fn of(numbers: Tensor<2>, basis: Tensor<2>, centres: Tensor<2>, length: f64) -> Self {
        let [rows, columns] = basis.dims();
        let terms = numbers.reshape([rows, columns, MOTION]) * basis.reshape([rows, columns, 1]);
        let sum = |from: usize, count: usize| terms.clone().narrow(1, from, count).sum_dim(1).reshape([rows, MOTION]);
        let (even, spline) = (sum(0, EVEN), sum(EVEN, columns - EVEN));
        let vector = |of: &Tensor<2>| of.clone().narrow(1, 3, 3);
        let shift = (even.clone() + spline.clone()).narrow(1, 0, 3) * length;
        Self { even: vector(&even), spline: vector(&spline), shift, centres }
    }

    /// The rotation less one of each row of `offsets` `[M, 3]` by the motion that `labels` `[M]` names.
    pub fn turned(&self, labels: &Tensor<1, Int>, offsets: &Tensor<2>) -> Tensor<2> {
        let of = |rows: &Tensor<2>| rows.clone().select(0, labels.clone());
        turned(&of(&self.even), &of(&self.spline), offsets)
    }

    /// `[N, 4]` rotations as quaternions w x y z.
    pub fn quaternions(&self) -> Tensor<2> {
        let identity = State::at_rest(self.shift.clone()).turns;
        let first = identity.clone() + turn(identity, self.even.clone());
        first.clone() + turn(first, self.spline.clone())
    }

    /// `[N, 12]`: the columns of each rotation less one, then the shift of what lies at `reference` in the first frame.
    pub fn affine(&self, reference: [f64; 3]) -> Tensor<2> {
        let rows = self.shift.dims()[0];
        let mut shift = self.shift.clone();
        let mut columns = Vec::with_capacity(4);
        for (axis, origin) in reference.into_iter().enumerate() {
            let unit: Vec<f64> = (0..3 * rows).map(|k| f64::from(u8::from(k % 3 == axis))).collect();
            let column = turned(&self.even, &self.spline, &constant(&self.shift, unit, [rows, 3]));
            shift = shift - column.clone() * (self.centres.clone().narrow(1, axis, 1) - origin);
            columns.push(column);
        }
        columns.push(shift);
        Tensor::cat(columns, 1)
    }
}

/// A table of constants in the type of `like`.
pub(super) fn constant(like: &Tensor<2>, values: Vec<f64>, shape: [usize; 2]) -> Tensor<2> {
    Tensor::from_data(TensorData::new(values, shape), (&like.device(), like.dtype()))
}

/// `C E u - u` for the even rotation `E` and the spline's `C`.
fn turned(even: &Tensor<2>, spline: &Tensor<2>, u: &Tensor<2>) -> Tensor<2> {
    let first = Factors::of(even).turned_by(even, u);
    let whole = u.clone() + first.clone();
    first + Factors::of(spline).turned_by(spline, &whole)
}
