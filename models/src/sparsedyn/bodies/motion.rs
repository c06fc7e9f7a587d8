//! Bodies as a Burn module: the numbers of their laws, and a smooth correction over the observed time while the law is
//! not chosen yet.

use burn::module::{Module, Param};
use burn::tensor::{Device, Int, Tensor, TensorData};
use gs_burn::glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::law::{BodyPose, Law, LawValues, NUMBERS, Term};
use crate::rotation::turn;
use crate::sparsedyn::state::State;
use crate::sparsedyn::turning::Factors;

/// Squared rotation rate that keeps a vanishing axis finite: far below any visible rotation, above the smallest `f32`
/// after division.
const AXIS_FLOOR: f64 = 1e-12;

/// Numbers of a correction at a knot: a shift of the centre and a rotation vector.
const CORRECTION: usize = 6;

/// A body's constants.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BodyFrame {
    /// The centre in the first frame, world, scene units.
    #[serde(with = "crate::bits")]
    pub centre: [f64; 3],
    /// The law.
    pub law: Law,
}

/// The laws of `K` bodies.
#[derive(Module, Debug)]
pub struct Bodies {
    /// `[K, 23]` numbers of the laws; lengths in units of `length`.
    pub numbers: Param<Tensor<2>>,
    /// `[K, 6 P]` corrections that set in at `P` knots over the observed time: shifts in units of `length`, rotation
    /// vectors in radians. `P` is 0 once laws are chosen.
    pub corrections: Param<Tensor<2>>,
    /// Constants of each body.
    #[module(skip)]
    pub frames: Vec<BodyFrame>,
    /// First and last observed time.
    #[module(skip)]
    pub span: [f64; 2],
    /// The unit of lengths, scene units.
    #[module(skip)]
    pub length: f64,
}

/// The bodies at one time: rotation vectors and centres.
struct Posed {
    /// `[K, 3]` of the law, radians.
    law: Tensor<2>,
    /// `[K, 3]` of the correction, which turns after the law; `None` without knots.
    correction: Option<Tensor<2>>,
    /// `[K, 3]`, world, scene units.
    centres: Tensor<2>,
}

impl Bodies {
    /// Bodies with the numbers of `values` (scene units), and `knots` knots of correction.
    pub fn new(
        frames: Vec<BodyFrame>,
        values: &[LawValues],
        span: [f64; 2],
        (length, knots): (f64, usize),
        device: &Device,
    ) -> Self {
        let scaled = values.iter().flat_map(|values| {
            let scale = scales(length);
            values.0.iter().zip(scale).map(|(x, scale)| (x / scale) as f32).collect::<Vec<_>>()
        });
        let numbers: Vec<f32> = scaled.collect();
        let count = frames.len();
        let numbers = Tensor::from_data(TensorData::new(numbers, [count, NUMBERS]), device);
        let corrections = Tensor::zeros([count, CORRECTION * knots], device);
        Self {
            numbers: Param::from_tensor(numbers),
            corrections: Param::from_tensor(corrections),
            frames,
            span,
            length,
        }
    }

    /// These bodies with others behind them, whose laws have the numbers of `values` (scene units) and no correction
    /// yet.
    pub fn extended(self, frames: &[BodyFrame], values: &[LawValues]) -> Self {
        let device = self.numbers.val().device();
        let more = Self::new(frames.to_vec(), values, self.span, (self.length, self.knots()), &device);
        let both = |a: Param<Tensor<2>>, b: Param<Tensor<2>>| {
            Param::from_tensor(Tensor::cat(vec![a.val(), b.val()], 0).detach())
        };
        Self {
            numbers: both(self.numbers, more.numbers),
            corrections: both(self.corrections, more.corrections),
            frames: self.frames.iter().chain(frames).cloned().collect(),
            ..self
        }
    }

    /// For each entry of `of` a body that moves as the one that it names.
    pub fn copied(self, of: &[usize]) -> Self {
        let device = self.numbers.val().device();
        let rows: Vec<i64> = of.iter().map(|body| *body as i64).collect();
        let rows = Tensor::<1, Int>::from_data(TensorData::new(rows, [of.len()]), &device);
        let picked = |a: Param<Tensor<2>>| Param::from_tensor(a.val().select(0, rows.clone()).detach());
        Self {
            numbers: picked(self.numbers),
            corrections: picked(self.corrections),
            frames: of.iter().map(|body| self.frames[*body].clone()).collect(),
            ..self
        }
    }

    /// Number of bodies.
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// Knots of the corrections.
    pub fn knots(&self) -> usize {
        self.corrections.dims()[1] / CORRECTION
    }

    /// The numbers of each body's law, scene units; reads them from the device.
    pub fn values(&self) -> Vec<LawValues> {
        let data = self.numbers.val().into_data();
        let numbers: Vec<f64> = data.iter::<f64>().collect();
        let scale = scales(self.length);
        let of = |(row, frame): (&[f64], &BodyFrame)| {
            let mask = frame.law.mask();
            let values = LawValues(std::array::from_fn(|k| row[k] * scale[k] * mask[k]));
            frame.law.constrained(values, self.span[1] - self.span[0])
        };
        numbers.chunks_exact(NUMBERS).zip(&self.frames).map(of).collect()
    }

    /// The pose of each body at `time`, with its correction; reads numbers from the device.
    pub fn poses(&self, time: f64) -> Vec<BodyPose> {
        let values = self.values();
        let data = self.corrections.val().into_data();
        let corrections: Vec<f64> = data.iter::<f64>().collect();
        let (knots, basis) = (self.knots(), steps(self.span, self.knots(), time));
        let one = |(index, values): (usize, &LawValues)| {
            let first = DVec3::from_array(self.frames[index].centre);
            let mut pose = values.pose(first, time - self.span[0]);
            let row = &corrections[CORRECTION * knots * index..CORRECTION * knots * (index + 1)];
            let sum = |offset: usize| -> DVec3 {
                let knot = |k: usize| DVec3::from_slice(&row[CORRECTION * k + offset..CORRECTION * k + offset + 3]);
                (0..knots).map(|k| basis[k] * knot(k)).sum()
            };
            if knots > 0 {
                pose.centre += self.length * sum(0);
                pose.rotation = DQuat::from_scaled_axis(sum(3)) * pose.rotation;
            }
            pose
        };
        values.iter().enumerate().map(one).collect()
    }

    /// The states at `time` of Gaussians at `positions` `[M, 3]` in the first frame, each of the body that `labels`
    /// `[M]` names; differentiable in positions and numbers.
    pub fn states(&self, positions: &Tensor<2>, labels: &Tensor<1, Int>, time: f64) -> State {
        let posed = self.posed(positions, time);
        let of = |rows: &Tensor<2>| rows.clone().select(0, labels.clone());
        let firsts = self.constant(positions, 3, |frame| frame.centre.to_vec());
        let offsets = positions.clone() - of(&firsts);
        let rotation = of(&posed.law);
        let mut turned = offsets.clone() + Factors::of(&rotation).turned_by(&rotation, &offsets);
        let identity = State::at_rest(positions.clone()).turns;
        let mut turns = identity.clone() + turn(identity, rotation);
        if let Some(correction) = posed.correction {
            let correction = of(&correction);
            turned = turned.clone() + Factors::of(&correction).turned_by(&correction, &turned);
            turns = turns.clone() + turn(turns, correction);
        }
        State { positions: turned + of(&posed.centres), turns }
    }

    fn posed(&self, like: &Tensor<2>, time: f64) -> Posed {
        let s = time - self.span[0];
        let mask = self.constant(like, NUMBERS, |frame| frame.law.mask().to_vec());
        let numbers = self.numbers.val() * mask;
        let vector = |term: Term| numbers.clone().narrow(1, term.numbers().start, 3);
        let first = Term::Oscillation.numbers().start;
        let (rate, phase) = (numbers.clone().narrow(1, first, 1), numbers.clone().narrow(1, first + 1, 1));
        let swing = (rate * s + phase.clone()).sin() - phase.sin();
        let (spin, up) = self.on_one_axis(vector(Term::Spin), vector(Term::SpinUp));
        let law = spin * s + up * (0.5 * s * s) + vector(Term::Swing) * swing.clone();
        let pivot = vector(Term::Pivot);
        // `-(R - 1) d`.
        let about = Factors::of(&law).turned_by(&law, &pivot);
        let shift =
            vector(Term::Velocity) * s + vector(Term::Acceleration) * (0.5 * s * s) + vector(Term::Sway) * swing
                - about;
        let firsts = self.constant(like, 3, |frame| frame.centre.to_vec());
        let mut centres = firsts + shift * self.length;
        let knots = self.knots();
        let correction = (knots > 0).then(|| {
            let basis = steps(self.span, knots, time);
            let basis = Tensor::<3>::from_data(TensorData::new(basis, [1, knots, 1]), (&like.device(), like.dtype()));
            let rows = self.corrections.val().reshape([self.len(), knots, CORRECTION]);
            let sum = (rows * basis).sum_dim(1).reshape([self.len(), CORRECTION]);
            centres = centres.clone() + sum.clone().narrow(1, 0, 3) * self.length;
            sum.narrow(1, 3, 3)
        });
        Posed { law, correction, centres }
    }

    /// [`Law::constrained`] for all bodies, differentiable: `[K, 3]` rotations and angular accelerations.
    fn on_one_axis(&self, spin: Tensor<2>, up: Tensor<2>) -> (Tensor<2>, Tensor<2>) {
        if !self.frames.iter().any(|frame| frame.law.has_one_axis()) {
            return (spin, up);
        }
        let half = 0.5 * (self.span[1] - self.span[0]);
        // 1 where both point the same way or one is zero, else -1; it has no gradient.
        let sign = (spin.clone() * up.clone()).sum_dim(1).detach().sign();
        let sign = sign.clone() + (sign.abs() - 1.0).abs();
        let sum = spin.clone() + up.clone() * sign * half;
        let squared = (sum.clone() * sum.clone()).sum_dim(1);
        // A rotation rate below the square root of this, radians per unit of time, has no axis to speak of.
        let axis = sum / (squared + AXIS_FLOOR).sqrt();
        let along = |vector: &Tensor<2>| axis.clone() * (vector.clone() * axis.clone()).sum_dim(1);
        let chosen = self.constant(&spin, 1, |frame| vec![f64::from(u8::from(frame.law.has_one_axis()))]);
        let mixed = |vector: Tensor<2>| {
            let along = along(&vector);
            (along - vector.clone()) * chosen.clone() + vector
        };
        (mixed(spin), mixed(up))
    }

    fn constant(&self, like: &Tensor<2>, columns: usize, of: impl Fn(&BodyFrame) -> Vec<f64>) -> Tensor<2> {
        let values: Vec<f64> = self.frames.iter().flat_map(of).collect();
        Tensor::from_data(TensorData::new(values, [self.len(), columns]), (&like.device(), like.dtype()))
    }
}

/// The unit of each number.
fn scales(length: f64) -> [f64; NUMBERS] {
    let mut scales = [1.0; NUMBERS];
    for term in [Term::Velocity, Term::Acceleration, Term::Sway, Term::Pivot] {
        scales[term.numbers()].fill(length);
    }
    scales
}

/// Values at `time` of `knots` smooth steps over `span`: the sums of a cubic B-spline and all later ones. The first is
/// 1 at all times, and a step at a later knot changes nothing before it, so what was learned of early times holds later
/// ones until they are seen.
fn steps(span: [f64; 2], knots: usize, time: f64) -> Vec<f64> {
    let mut values = spline_basis(span, knots, time);
    for k in (1..knots).rev() {
        values[k - 1] += values[k];
    }
    values
}

/// Values at `time` of `knots` cubic B-splines over `span`; outside it those at its nearer end. They sum to 1.
fn spline_basis([first, last]: [f64; 2], knots: usize, time: f64) -> Vec<f64> {
    let mut basis = vec![0.0; knots];
    if knots < 4 {
        if let Some(constant) = basis.first_mut() {
            *constant = 1.0;
        }
        return basis;
    }
    let parts = (knots - 3) as f64;
    let share = if last > first { ((time - first) / (last - first)).clamp(0.0, 1.0) } else { 0.0 };
    let position = (share * parts).min(parts - 1e-9);
    let part = position.floor();
    let x = position - part;
    let weights = [
        (1.0 - x).powi(3) / 6.0,
        (3.0 * x.powi(3) - 6.0 * x * x + 4.0) / 6.0,
        (-3.0 * x.powi(3) + 3.0 * x * x + 3.0 * x + 1.0) / 6.0,
        x.powi(3) / 6.0,
    ];
    basis[part as usize..part as usize + 4].copy_from_slice(&weights);
    basis
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splines_sum_to_one_and_are_smooth() {
        for knots in [1, 4, 5, 9] {
            let mut before: Option<Vec<f64>> = None;
            for k in 0..=200 {
                let time = -0.1 + 1.2 * f64::from(k) / 200.0;
                let basis = spline_basis([0.0, 1.0], knots, time);
                assert!((basis.iter().sum::<f64>() - 1.0).abs() < 1e-12);
                if let Some(before) = before {
                    assert!(basis.iter().zip(before).all(|(a, b)| (a - b).abs() < 0.05), "{knots} knots at {time}");
                }
                before = Some(basis);
            }
        }
        assert!(spline_basis([0.0, 1.0], 0, 0.3).is_empty());
    }
}
