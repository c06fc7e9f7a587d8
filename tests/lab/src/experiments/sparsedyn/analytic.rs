//! Motions that are known exactly: linear fields `x' = (M + [w]) (x - c)`, through the trainer's own rollout, in `f64`.

use anyhow::{Result, bail};
use burn::tensor::{DType, Device, Tensor, TensorData};
use glam::{DMat3, DVec3};
use gs_burn::device::{BACKENDS, select};
use gs_models::sparsedyn::field::offsets;
use gs_models::sparsedyn::{Ask, Asked, Dynamics, Integrator, Rollout, RolloutOptions, State};

/// Integrators with their names and orders.
pub const INTEGRATORS: [(&str, Integrator, f64); 3] =
    [("rk2", Integrator::Rk2, 2.0), ("rk4", Integrator::Rk4, 4.0), ("screw", Integrator::Screw, 2.0)];

/// Errors up to this are rounding: 1024 steps of some ten operations at 1e-16 each, times the growth of the fields,
/// with room.
pub const EXACT: f64 = 1e-10;

/// Steps per unit of time: from a step that no run has to one far below a frame.
pub const STEPS_PER_UNIT: [f64; 8] = [8.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0, 1024.0];

/// Errors above rounding over which an order is fitted, the finest: coarser ones have a share of the next order.
const FITTED: usize = 4;

/// The reference point of velocities: not the origin.
const CENTRE: DVec3 = DVec3::new(0.3, -0.2, 0.5);

/// A linear field, steady over time.
#[derive(Debug, Clone)]
pub struct Linear {
    pub name: &'static str,
    /// `M`, the part that the field gives as a velocity that depends on the position, per unit of time.
    pub matrix: DMat3,
    /// `w`, the part that it gives as an angular velocity, radians per unit of time.
    pub angular: DVec3,
}

impl Linear {
    /// A rotation about z at `w` radians per unit of time, given as an angular velocity.
    pub fn rotation(w: f64) -> Self {
        Self { name: "rotation", matrix: DMat3::ZERO, angular: DVec3::new(0.0, 0.0, w) }
    }

    /// The fields of the experiments, at about 2 radians per unit of time.
    pub fn all() -> [Self; 5] {
        let rows = |rows: [[f64; 3]; 3]| DMat3::from_cols_array_2d(&rows).transpose();
        let none = DVec3::ZERO;
        let shear = rows([[0.0, 1.5, 0.0], [0.0; 3], [0.0; 3]]);
        let saddle = rows([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0; 3]]);
        // Position along x and velocity along y: x'' = -w^2 x - 2 z w x', w = 2, z = 0.1.
        let oscillator = rows([[0.0, 1.0, 0.0], [-4.0, -0.4, 0.0], [0.0; 3]]);
        [
            Self::rotation(2.0),
            Self { name: "shear", matrix: shear, angular: none },
            Self { name: "saddle", matrix: saddle, angular: none },
            Self { name: "damped oscillator", matrix: oscillator, angular: none },
            Self { name: "shear and rotation", matrix: shear, angular: DVec3::new(0.0, 0.0, 2.0) },
        ]
    }

    /// Where a Gaussian that begins at `first` is at `time`, exactly.
    pub fn position(&self, first: DVec3, time: f64) -> DVec3 {
        CENTRE + exponential((self.matrix + cross(self.angular)) * time) * (first - CENTRE)
    }

    /// The rollout from 0 to `time`, and back to 0 if `back`, of Gaussians that begin at [`starts`].
    pub fn rolled(&self, integrator: Integrator, step: f64, time: f64, back: bool, device: &Device) -> Vec<State> {
        let options = RolloutOptions { ask: Ask::Stage, integrator, step, start: 0.0 };
        let begin = State::at_rest(rows(&starts(), device));
        let end = Rollout { field: self, options }.states(&begin, &[time]).remove(0);
        if !back {
            return vec![begin, end];
        }
        let options = RolloutOptions { start: time, ..options };
        let again = Rollout { field: self, options }.states(&end, &[0.0]).remove(0);
        vec![begin, again]
    }
}

impl Asked for Linear {
    fn ask(&self, positions: Tensor<2>, _t: f64) -> Dynamics {
        let from_centre = offsets(self, &positions);
        let place = (&positions.device(), positions.dtype());
        // The columns of M, row by row, are the rows of its transpose.
        let matrix = Tensor::from_data(TensorData::new(self.matrix.to_cols_array().to_vec(), [3, 3]), place);
        let angular = Tensor::<2>::from_data(TensorData::new(self.angular.to_array().to_vec(), [1, 3]), place);
        Dynamics {
            velocity: from_centre.matmul(matrix),
            acceleration: positions.zeros_like(),
            angular: angular.repeat_dim(0, positions.dims()[0]),
            angular_acceleration: positions.zeros_like(),
        }
    }

    fn centre(&self) -> [f64; 3] {
        CENTRE.to_array()
    }
}

/// Where the Gaussians begin: at a distance of 1 and less from the centre, off every axis of the fields.
pub fn starts() -> [DVec3; 3] {
    [DVec3::new(1.0, 0.0, 0.0), DVec3::new(-0.5, 0.6, 0.3), DVec3::new(0.2, -0.8, -0.4)].map(|offset| CENTRE + offset)
}

/// Distance of a position from the centre about the axis z.
pub fn radius(position: DVec3) -> f64 {
    (position - CENTRE).truncate().length()
}

/// The positions of a state.
pub fn positions(state: &State) -> Vec<DVec3> {
    let values: Vec<f64> = state.positions.to_data().iter::<f64>().collect();
    values.chunks_exact(3).map(DVec3::from_slice).collect()
}

/// Largest difference of two states, over positions (scene units) and quaternions.
pub fn difference(a: &State, b: &State) -> f64 {
    let most = |a: &Tensor<2>, b: &Tensor<2>| -> f64 {
        let (a, b) = (a.to_data(), b.to_data());
        a.iter::<f64>().zip(b.iter::<f64>()).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    most(&a.positions, &b.positions).max(most(&a.turns, &b.turns))
}

/// Slope of the logarithm of the error over that of the step, by least squares over the finest errors that are not
/// rounding; `None` if fewer than two are left.
pub fn slope(errors: &[(f64, f64)]) -> Option<f64> {
    let mut points: Vec<(f64, f64)> =
        errors.iter().filter(|(_, error)| *error > EXACT).map(|(step, error)| (step.ln(), error.ln())).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points.truncate(FITTED);
    if points.len() < 2 {
        return None;
    }
    let count = points.len() as f64;
    let (x, y) = (points.iter().map(|p| p.0).sum::<f64>() / count, points.iter().map(|p| p.1).sum::<f64>() / count);
    let covariance: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    Some(covariance / points.iter().map(|p| (p.0 - x).powi(2)).sum::<f64>())
}

/// The first device of this build that computes in `f64`.
///
/// # Errors
/// When the build has no backend on the CPU.
pub fn double() -> Result<Device> {
    match BACKENDS.into_iter().find(|kind| kind.is_built() && kind.is_cpu()) {
        Some(kind) => Ok(select(kind.name())?),
        None => bail!(
            "expected a build with a backend on the CPU (flex or ndarray), which alone compute in f64, found none"
        ),
    }
}

fn rows(positions: &[DVec3], device: &Device) -> Tensor<2> {
    let values: Vec<f64> = positions.iter().flat_map(|position| position.to_array()).collect();
    Tensor::from_data(TensorData::new(values, [positions.len(), 3]), (device, DType::F64))
}

fn cross(w: DVec3) -> DMat3 {
    DMat3::from_cols(w.cross(DVec3::X), w.cross(DVec3::Y), w.cross(DVec3::Z))
}

/// `exp(A)`: the power series of a 2^10-th of it, squared ten times.
fn exponential(a: DMat3) -> DMat3 {
    const HALVINGS: i32 = 10;
    const TERMS: i32 = 12;
    let small = a * 0.5_f64.powi(HALVINGS);
    let sum = (1..=TERMS).rev().fold(DMat3::IDENTITY, |sum, k| DMat3::IDENTITY + small * sum * f64::from(k).recip());
    (0..HALVINGS).fold(sum, |power, _| power * power)
}
