//! Polynomial motion, Eq. 2: `p(t') = p(t_i) + sum_j v_j (t'^(j+1) - t_i^(j+1)) / (j + 1)`, j = 0 to l.
//!
//! Its derivative by `t'` is the velocity `sum_j v_j t'^j`. Times are 0 to 1 over the window and beyond 1 for future
//! frames, so `v_j` is in metres per window for every j; [`PolynomialMotion::per_second`] converts.

use burn::tensor::{Tensor, TensorData, assert_shape};
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
    /// Of degree 0 to 3.
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
    /// `[N, 3 (l + 1)]`, metres per window. Zero exactly where a row's own time is `t` in the tensor's float type. Differentiable
    /// by all tensors.
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
