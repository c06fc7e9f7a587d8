//! Polynomial motion, Eq. 2: `p(t') = p(t_i) + sum_j v_j (t'^(j+1) - t_i^(j+1)) / (j + 1)`, j = 0 to l.
//!
//! Its derivative by `t'` is the velocity `sum_j v_j t'^j`. Times are 0 to 1 over the window and beyond 1 for future
//! frames, so `v_j` is in metres per window for every j; [`PolynomialMotion::per_second`] converts.

use burn::tensor::{Tensor, TensorData, assert_shape};
use gs_burn::glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

use super::error::{FluxError, check_range};

/// Highest degree: the paper found nothing to gain beyond 1, and tried up to 3.
pub const DEGREE_MAX: usize = 3;

/// The motion of degree `l`; constant velocity is 0, constant acceleration 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "usize", into = "usize")]
pub struct PolynomialMotion {
    degree: usize,
}

impl TryFrom<usize> for PolynomialMotion {
    type Error = FluxError;

    fn try_from(degree: usize) -> Result<Self, FluxError> {
        Self::new(degree)
    }
}

impl From<PolynomialMotion> for usize {
    fn from(motion: PolynomialMotion) -> Self {
        motion.degree
    }
}

impl PolynomialMotion {
    /// A motion of degree 0 to 3.
    ///
    /// # Errors
    /// For a higher degree.
    pub fn new(degree: usize) -> Result<Self, FluxError> {
        check_range("the degree of the velocity", degree as f64, [0.0, DEGREE_MAX as f64], "0 to 3")?;
        Ok(Self { degree })
    }

    /// The degree `l`.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Columns of a velocity tensor, `3 (l + 1)`: `v_0`, `v_1`, ...
    pub fn columns(&self) -> usize {
        3 * (self.degree + 1)
    }

    /// Displacements `[N, 3]`, metres, from each row's own time `times` `[N]` to the time `t`, by `velocity`
    /// `[N, 3 (l + 1)]`, metres per window. Zero exactly where a row's own time is `t` in the tensor's float type.
    /// Differentiable by all tensors.
    ///
    /// # Panics
    /// When shapes disagree.
    pub fn displacement(&self, velocity: Tensor<2>, times: Tensor<1>, t: f64) -> Tensor<2> {
        let rows = times.dims()[0];
        assert_shape!(velocity, [rows, self.columns()]);
        let own: Tensor<2> = times.reshape([rows, 1]);
        let target = Tensor::from_data(TensorData::new(vec![t], [1, 1]), (&own.device(), own.dtype()));
        // The same products for both times: equal times cancel to the bit.
        let (mut own_power, mut power): (Tensor<2>, Tensor<2>) = (own.clone(), target.clone());
        let mut sum = velocity.clone().narrow(1, 0, 3) * (power.clone() - own_power.clone());
        for j in 1..=self.degree {
            (own_power, power) = (own_power * own.clone(), power * target.clone());
            let factor = (power.clone() - own_power.clone()) / (j + 1) as f64;
            sum = sum + velocity.clone().narrow(1, 3 * j, 3) * factor;
        }
        sum
    }

    /// The displacement of one row of [`displacement`](Self::displacement) on the host: from time `own` to `t` by
    /// `velocity`, `3 (l + 1)` numbers.
    pub fn shift(&self, velocity: &[f64], own: f64, t: f64) -> [f64; 3] {
        let of = |j: usize| (t.powi(j as i32 + 1) - own.powi(j as i32 + 1)) / (j + 1) as f64;
        [0, 1, 2].map(|axis| (0..=self.degree).map(|j| velocity[3 * j + axis] * of(j)).sum())
    }

    /// The speed of one row at the time `t` on the host, metres per window; `velocity` has `3 (l + 1)` numbers.
    pub fn speed(&self, velocity: &[f64], t: f64) -> f64 {
        let along = |axis: usize| (0..=self.degree).map(|j| velocity[3 * j + axis] * t.powi(j as i32)).sum::<f64>();
        along(0).hypot(along(1)).hypot(along(2))
    }

    /// The velocity of `degree` (at most the own one) nearest to one row's in the mean square over the window;
    /// coefficients above it are 0.
    pub fn lowered(&self, velocity: &[f64], degree: usize) -> Vec<f64> {
        let mut lowered = vec![0.0; self.columns()];
        if degree >= self.degree {
            lowered.copy_from_slice(velocity);
            return lowered;
        }
        // Normal equations of the monomials 1, u, u^2: `<u^i, u^k> = 1 / (i + k + 1)` over 0 to 1. Rows of the unit
        // matrix fill up.
        let product = |i: usize, k: usize| 1.0 / (i + k + 1) as f64;
        let entry = |i: usize, k: usize| match i.max(k) <= degree {
            true => product(i, k),
            false => f64::from(u8::from(i == k)),
        };
        let inverse = DMat3::from_cols_array_2d(&[0, 1, 2].map(|k| [0, 1, 2].map(|i| entry(i, k)))).inverse();
        for axis in 0..3 {
            let right = |i: usize| (0..=self.degree).map(|j| velocity[3 * j + axis] * product(i, j)).sum::<f64>();
            let right = DVec3::from_array([0, 1, 2].map(|i| if i <= degree { right(i) } else { 0.0 }));
            let found = (inverse * right).to_array();
            (0..=degree).for_each(|j| lowered[3 * j + axis] = found[j]);
        }
        lowered
    }

    /// Velocities `[N, 3]` at the time `t`, metres per window.
    ///
    /// # Panics
    /// When `velocity` has not `3 (l + 1)` columns.
    pub fn velocity(&self, velocity: Tensor<2>, t: f64) -> Tensor<2> {
        let rows = velocity.dims()[0];
        assert_shape!(velocity, [rows, self.columns()]);
        let first = velocity.clone().narrow(1, 0, 3);
        (1..=self.degree).fold(first, |sum, j| sum + velocity.clone().narrow(1, 3 * j, 3) * t.powi(j as i32))
    }

    /// A velocity in metres per window, in metres per second; `window` in seconds, positive.
    pub fn per_second(velocity: Tensor<2>, window: f64) -> Tensor<2> {
        velocity / window
    }

    /// The flow `[N, 3]`, metres, between the times `t` and `t + step` of the window.
    pub fn flow(&self, velocity: Tensor<2>, t: f64, step: f64) -> Tensor<2> {
        let rows = velocity.dims()[0];
        let times = Tensor::full([rows], t, (&velocity.device(), velocity.dtype()));
        self.displacement(velocity, times, t + step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The velocity at `u` along x.
    fn at(velocity: &[f64], u: f64) -> f64 {
        (0..velocity.len() / 3).map(|j| velocity[3 * j] * u.powi(j as i32)).sum()
    }

    #[test]
    fn a_lowered_velocity_leaves_a_rest_that_no_lower_degree_has() {
        let motion = PolynomialMotion::new(3).expect("a degree");
        let velocity = vec![1.0, -2.0, 0.5, 3.0, 0.7, -1.1, -4.0, 2.2, 0.1, 5.0, 0.3, 0.9];
        for degree in 0..=3 {
            let lowered = motion.lowered(&velocity, degree);
            assert!(lowered[3 * (degree + 1)..].iter().all(|x| *x == 0.0));
            // The rest is orthogonal to every lower power: the midpoint rule on 20,000 parts is exact to 1e-8.
            for power in 0..=degree as i32 {
                let parts = 20_000;
                let sum: f64 = (0..parts)
                    .map(|k| (f64::from(k) + 0.5) / f64::from(parts))
                    .map(|u| (at(&lowered, u) - at(&velocity, u)) * u.powi(power))
                    .sum();
                assert!((sum / f64::from(parts)).abs() < 1e-7, "degree {degree}, power {power}");
            }
        }
        assert_eq!(motion.lowered(&velocity, 3), velocity);
    }
}
