//! The paths of moving Gaussians, to be asked at any time: Eq. 2 and its velocity, Eq. 3.
//!
//! `mu(t) = mu_0 + sum_{k=1..K} c_k s^k + R(s)`, `s = (t - t0) / half`, `c_k = f^(k) half^k / k!` `[3]`;
//! `v(t) = (sum_k k c_k s^(k-1) + R'(s)) / half`. Coefficients are stored as the displacement they make at the window's
//! edge, so all orders have one scale, whatever the unit of time, and one learning rate suits them all. Rotation has a
//! series of its own, of the rotation vector ([`rotation`](crate::rotation)). Only the rows listed move; the others cost
//! nothing. Outside the window see [`window`](super::window).

use burn::tensor::{Int, Tensor, TensorData, assert_shape};
use gs_burn::ops::products::scaled;
use gs_burn::ops::rows::{add_rows, take_rows};
use gs_burn::{Gaussians, exact_matmul, profile};

use super::kinks::Kinks;
use super::remainder::Remainder;
use super::window::{Sample, TimeWindow, powers};
use crate::rotation::turn;

/// How `M` of a scene's `N` Gaussians move: [`TaylorMotion::paths`](super::TaylorMotion::paths) with the remainder's network
/// evaluated, which is worth doing once for all times.
#[derive(Debug, Clone)]
pub struct Paths {
    /// `[M]`, which Gaussians move; each at most once.
    pub rows: Tensor<1, Int>,
    /// `[M, 3 K]`, blocks `c_1 .. c_K` of three, scene units: displacement at `|s| = 1`.
    pub position: Tensor<2>,
    /// `[M, 3 Kr]`, likewise for the rotation vector, radians, world axes.
    pub rotation: Tensor<2>,
    /// The window.
    pub window: TimeWindow,
    /// The part of the motion that the polynomial misses, of the same `M` rows.
    pub remainder: Option<Remainder>,
    /// Sudden changes of velocity, of the same `M` rows.
    pub kinks: Option<Kinks>,
}

/// A time at which to move the Gaussians, through which a gradient may reach the time itself.
#[derive(Debug, Clone)]
pub struct Instant {
    /// The data set's unit.
    pub t: f64,
    /// `[1]`, zero in value: its gradient is the loss's derivative by `t`. See
    /// [`Exposure::instants`](super::Exposure::instants).
    pub shift: Option<Tensor<1>>,
}

impl From<f64> for Instant {
    fn from(t: f64) -> Self {
        Self { t, shift: None }
    }
}

impl Paths {
    /// `M`, how many Gaussians move.
    pub fn len(&self) -> usize {
        self.rows.dims()[0]
    }

    /// Whether none moves.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// `K`, the order of the position.
    pub fn order(&self) -> usize {
        self.position.dims()[1] / 3
    }

    /// `Kr`, the order of the rotation.
    pub fn rotation_order(&self) -> usize {
        self.rotation.dims()[1] / 3
    }

    /// Moving centres less those of `t0`, `[M, 3]`, scene units. Eq. 2.
    pub fn displacement(&self, t: f64) -> Tensor<2> {
        self.position_sum(t, |sample| sample.value)
    }

    /// Velocity of the moving centres, `[M, 3]`, scene units per unit of `t`: the exact derivative of
    /// [`displacement`](Self::displacement), remainder included. Eq. 3.
    pub fn velocity(&self, t: f64) -> Tensor<2> {
        let half = self.window.half;
        self.position_sum(t, |sample| sample.slope / half)
    }

    /// The turn since `t0` as a rotation vector, `[M, 3]`, radians, world axes.
    pub fn rotation_vector(&self, t: f64) -> Tensor<2> {
        self.rotation_sum(t, |sample| sample.value)
    }

    fn position_sum(&self, t: f64, part: impl Fn(Sample) -> f64) -> Tensor<2> {
        let s = self.window.normalised(t);
        let mut sum = series(&self.position, powers(s, self.order()).map(&part).collect());
        if let Some(rest) = &self.remainder {
            sum = sum + series(&rest.weights, rest.functions(s).into_iter().map(&part).collect());
        }
        if let Some(kinks) = &self.kinks {
            sum = sum + series(&kinks.jumps.val(), kinks.functions(s).into_iter().map(&part).collect());
        }
        sum
    }

    fn rotation_sum(&self, t: f64, part: impl Fn(Sample) -> f64) -> Tensor<2> {
        let s = self.window.normalised(t);
        series(&self.rotation, powers(s, self.rotation_order()).map(part).collect())
    }

    /// Displacement and rotation vector, with the gradient by the time where the instant asks for it.
    fn moved_by(&self, instant: &Instant) -> (Tensor<2>, Tensor<2>) {
        let (displacement, rotation) = (self.displacement(instant.t), self.rotation_vector(instant.t));
        let Some(shift) = &instant.shift else { return (displacement, rotation) };
        let shift = shift.clone().cast(displacement.dtype());
        let by_shift = |rate: Tensor<2>| -> Tensor<2> { scaled(shift.clone(), rate).squeeze_dim(0) };
        let half = self.window.half;
        let velocity = self.velocity(instant.t).detach();
        let turning = self.rotation_sum(instant.t, |sample| sample.slope / half).detach();
        (displacement + by_shift(velocity), rotation + by_shift(turning))
    }

    /// All centres at `t`: `means` `[N, 3]` of `t0` with the moving rows moved.
    pub fn means_at(&self, means: Tensor<2>, t: f64) -> Tensor<2> {
        // Exactly the stored ones at t0, to the sign of a zero.
        if self.is_empty() || t == self.window.t0 {
            return means;
        }
        add_rows(means, &self.rows, self.displacement(t))
    }

    /// All orientations at `t`: `quats` `[N, 4]` of `t0` (any norm, kept) with the moving rows turned.
    pub fn quats_at(&self, quats: Tensor<2>, t: f64) -> Tensor<2> {
        if self.is_empty() || self.rotation_order() == 0 || t == self.window.t0 {
            return quats;
        }
        let added = turn(take_rows(quats.clone(), &self.rows), self.rotation_vector(t));
        add_rows(quats, &self.rows, added)
    }

    /// Velocities of all `n` Gaussians at `t`, `[n, 3]`, scene units per unit of `t`; zero for those that do not move.
    pub fn velocities(&self, n: usize, t: f64) -> Tensor<2> {
        let _stage = profile::stage("motion samples");
        let zeros = Tensor::zeros([n, 3], (&self.position.device(), self.position.dtype()));
        if self.is_empty() {
            return zeros;
        }
        add_rows(zeros, &self.rows, self.velocity(t))
    }

    /// The scene at `t`. At `t0` itself these are the stored Gaussians, and no coefficient is in their graph.
    pub fn moved(&self, gaussians: &Gaussians, t: f64) -> Gaussians {
        let _stage = profile::stage("motion samples");
        Gaussians::from_tensors(
            self.means_at(gaussians.means.val(), t),
            self.quats_at(gaussians.quats.val(), t),
            gaussians.log_scales.val(),
            gaussians.opacity_logits.val(),
            gaussians.sh.val(),
        )
    }

    /// Centres `[M, 3]` and orientations `[M, 4]` of the moving rows alone, from all rows at `t0`
    /// (`[N, 3]`, `[N, 4]`).
    pub fn sample_rows(&self, means: &Tensor<2>, quats: &Tensor<2>, at: impl Into<Instant>) -> (Tensor<2>, Tensor<2>) {
        self.samples(means, quats, &[at.into()]).remove(0)
    }

    /// [`sample_rows`](Self::sample_rows) at each of the `instants` of an exposure. The rows are picked out once, and
    /// their gradients put back once.
    pub fn samples(&self, means: &Tensor<2>, quats: &Tensor<2>, instants: &[Instant]) -> Vec<(Tensor<2>, Tensor<2>)> {
        let _stage = profile::stage("motion samples");
        if self.is_empty() {
            let none = |columns| Tensor::zeros([0, columns], (&means.device(), means.dtype()));
            return instants.iter().map(|_| (none(3), none(4))).collect();
        }
        let means = take_rows(means.clone(), &self.rows);
        let quats = take_rows(quats.clone(), &self.rows);
        let sample = |instant: &Instant| {
            let (displacement, rotation) = self.moved_by(instant);
            let turns = self.rotation_order() > 0;
            let turned = if turns { quats.clone() + turn(quats.clone(), rotation) } else { quats.clone() };
            (means.clone() + displacement, turned)
        };
        instants.iter().map(sample).collect()
    }
}

/// `sum_k factors[k] block_k` of `coefficients` `[M, 3 K]`, `[M, 3]`.
fn series(coefficients: &Tensor<2>, factors: Vec<f64>) -> Tensor<2> {
    let [rows, columns] = coefficients.dims();
    assert_shape!(coefficients, [rows, 3 * factors.len()]);
    let options = (&coefficients.device(), coefficients.dtype());
    if rows == 0 || columns == 0 {
        return Tensor::zeros([rows, 3], options);
    }
    // One product with [f_1 I; f_2 I; ...] instead of K slices, products and sums.
    let mut matrix = vec![0.0; 9 * factors.len()];
    for (k, factor) in factors.into_iter().enumerate() {
        (0..3).for_each(|axis| matrix[9 * k + 4 * axis] = factor);
    }
    exact_matmul(coefficients.clone(), Tensor::from_data(TensorData::new(matrix, [columns, 3]), options))
}
