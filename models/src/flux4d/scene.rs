//! The reconstructed scene: Gaussians of which some carry a velocity, as a [`DynamicScene`] in seconds.
//!
//! Static by evidence: a row whose speed stays below a threshold carries none. Resting rows come first and are the same
//! tensors at all times; only moving rows are computed for a time.

use burn::module::{Module, Param};
use burn::tensor::{Int, Tensor, TensorData, assert_shape};
use gs_burn::{Gaussians, MovingSample};

use super::error::{FluxError, check_length, check_range};
use super::motion::PolynomialMotion;
use crate::basis::{MotionBasis, TimeFunction};
use crate::scene::DynamicScene;

/// Slowest speed that counts as motion, metres per second: half the speed below which the bucketed metrics call a point
/// static (0.04 m a frame). In half a window of 1 s it is 10 cm.
pub const REST_SPEED: f64 = 0.2;
/// Times of the window at which the speed is looked at. A cubic's speed between them differs little from theirs.
const LOOKS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

/// Gaussians and polynomial motion.
#[derive(Module, Debug)]
pub struct FluxScene {
    /// `N - M` resting Gaussians, then `M` moving ones, each of these at its own time.
    pub gaussians: Gaussians,
    /// Velocities of the moving rows, `[M, 3 (l + 1)]`, metres per window.
    pub velocity: Param<Tensor<2>>,
    /// `[M]`, own times of the moving rows, 0 to 1 in the window.
    #[module(skip)]
    pub times: Vec<f32>,
    /// `[N]`, the row of each Gaussian before resting and moving ones were parted.
    #[module(skip)]
    pub rows: Vec<u32>,
    /// The velocity's polynomial.
    #[module(skip)]
    pub motion: PolynomialMotion,
    /// First and last time of the input frames, seconds.
    #[module(skip)]
    pub window: [f64; 2],
}

impl FluxScene {
    /// Parts `gaussians` (each row at its own time of `times`, 0 to 1) into resting and moving ones: those move whose
    /// speed reaches `rest_speed` (metres per second) at some time of the `window` (seconds). `velocity` is `[N, 3 (l +
    /// 1)]`, metres per window. The result is outside autodiff.
    ///
    /// # Errors
    /// When there is not one time for each row, the window has no length, or a velocity is not finite.
    ///
    /// # Panics
    /// When `velocity` has another shape.
    pub fn new(
        gaussians: Gaussians,
        velocity: Tensor<2>,
        times: &[f32],
        motion: PolynomialMotion,
        window: [f64; 2],
        rest_speed: f64,
    ) -> Result<Self, FluxError> {
        let count = gaussians.len();
        check_length("times", count, times.len())?;
        let length = window[1] - window[0];
        check_range("the window's length in seconds", length, [1e-3, 1e6], "1 ms or more")?;
        assert_shape!(velocity, [count, motion.columns()]);
        let velocity = velocity.inner();
        let moves = moving(&velocity, motion, rest_speed * length)?;
        let (moving, resting): (Vec<u32>, Vec<u32>) = (0..count as u32).partition(|row| moves[*row as usize]);
        let own = moving.iter().map(|row| times[*row as usize]).collect();
        let velocity = take(velocity, &moving);
        let rows = [resting, moving].concat();
        let gaussians = reordered(&gaussians, &rows);
        Ok(Self { gaussians, velocity: Param::from_tensor(velocity), times: own, rows, motion, window })
    }

    /// `M`, how many Gaussians move.
    pub fn moving(&self) -> usize {
        self.times.len()
    }

    /// `N - M`, how many rest.
    pub fn resting(&self) -> usize {
        self.gaussians.len() - self.moving()
    }

    /// A time in seconds, 0 to 1 in the window.
    pub fn in_window(&self, t: f64) -> f64 {
        (t - self.window[0]) / (self.window[1] - self.window[0])
    }

    /// Means of the moving rows at time `t` (seconds), `[M, 3]`.
    pub fn moving_means(&self, t: f64) -> Tensor<2> {
        let means = self.gaussians.means.val();
        if self.moving() == 0 {
            return take(means, &[]);
        }
        let own = TensorData::new(self.times.clone(), [self.moving()]);
        let own = Tensor::from_data(own, (&means.device(), means.dtype()));
        let shift = self.motion.displacement(self.velocity.val(), own, self.in_window(t));
        means.narrow(0, self.resting(), self.moving()) + shift
    }

    /// The moving rows, and their means and orientations at each of `times` (seconds), for
    /// [`render_exposure`](gs_burn::render_exposure()), which draws the resting rows once for all of them.
    pub fn samples(&self, times: &[f64]) -> (Vec<u32>, Vec<MovingSample>) {
        let rows: Vec<u32> = (self.resting() as u32..self.gaussians.len() as u32).collect();
        let quats = take(self.gaussians.quats.val(), &rows);
        let sample = |t: &f64| MovingSample { means: self.moving_means(*t), quats: quats.clone() };
        (rows, times.iter().map(sample).collect())
    }

    /// Some of the moving rows at time `t` (seconds), in the order of `rows`: places among the moving ones, 0 to M - 1,
    /// as an [`Actor`](super::actors::Actor) has them. Outside autodiff.
    pub fn moving_at(&self, t: f64, rows: &[u32]) -> Gaussians {
        let rows: Vec<u32> = rows.iter().map(|row| self.resting() as u32 + row).collect();
        reordered(&self.at(t), &rows)
    }

    /// Velocities of the moving rows at time `t` (seconds), `[M, 3]`, metres per second.
    pub fn moving_velocity(&self, t: f64) -> Tensor<2> {
        let velocity = self.motion.velocity(self.velocity.val(), self.in_window(t));
        PolynomialMotion::per_second(velocity, self.window[1] - self.window[0])
    }
}

impl DynamicScene for FluxScene {
    fn at(&self, t: f64) -> Gaussians {
        if self.moving() == 0 {
            return self.gaussians.clone();
        }
        let moved = self.moving_means(t);
        // A tensor without rows cannot be cut off.
        let means = match self.resting() {
            0 => moved,
            count => Tensor::cat(vec![self.gaussians.means.val().narrow(0, 0, count), moved], 0),
        };
        let Gaussians { quats, log_scales, opacity_logits, sh, .. } = self.gaussians.clone();
        Gaussians::from_tensors(means, quats.val(), log_scales.val(), opacity_logits.val(), sh.val())
    }

    fn velocity(&self, t: f64) -> Tensor<2> {
        let means = self.gaussians.means.val();
        if self.moving() == 0 {
            return means.zeros_like();
        }
        match self.resting() {
            0 => self.moving_velocity(t),
            count => Tensor::cat(vec![means.narrow(0, 0, count).zeros_like(), self.moving_velocity(t)], 0),
        }
    }

    fn span(&self) -> Option<[f64; 2]> {
        (self.moving() > 0).then_some(self.window)
    }

    /// `sum_j v_j u^(j+1) / (j + 1)` from the scene at the window's begin, where `u` is 0.
    fn basis(&self) -> Option<MotionBasis> {
        if self.moving() == 0 {
            return None;
        }
        let blocks = 0..=self.motion.degree();
        let velocity = self.velocity.val().inner();
        let scaled = blocks.clone().map(|j| velocity.clone().narrow(1, 3 * j, 3) / (j + 1) as f64);
        Some(MotionBasis {
            base: self.at(self.window[0]),
            rows: (self.resting() as u32..self.gaussians.len() as u32).collect(),
            t0: self.window[0],
            half: self.window[1] - self.window[0],
            functions: blocks.map(|j| TimeFunction::power(j as u32 + 1)).collect(),
            position: Tensor::cat(scaled.collect(), 1),
            turns: Vec::new(),
            rotation: Tensor::zeros([self.moving(), 0], &self.gaussians.device()),
            carried: None,
        })
    }
}

/// The rows that reach `speed`, metres per window.
fn moving(velocity: &Tensor<2>, motion: PolynomialMotion, speed: f64) -> Result<Vec<bool>, FluxError> {
    let values: Vec<f64> = velocity.to_data().iter::<f64>().collect();
    let largest = |row: &[f64]| {
        let at = |u: f64| {
            let axis = |axis: usize| (0..=motion.degree()).map(|j| row[3 * j + axis] * u.powi(j as i32)).sum::<f64>();
            (0..3).map(|a| axis(a).powi(2)).sum::<f64>().sqrt()
        };
        // `max` would drop a NaN.
        LOOKS.into_iter().map(at).fold(0.0, |best: f64, s| if s > best || s.is_nan() { s } else { best })
    };
    let of_row = |row: &[f64]| {
        let largest = largest(row);
        check_range("a velocity in metres per window", largest, [0.0, 1e6], "a finite number")?;
        Ok(largest >= speed)
    };
    values.chunks_exact(motion.columns()).map(of_row).collect()
}

/// The Gaussians `rows`, in this order, outside autodiff.
pub(super) fn reordered(gaussians: &Gaussians, rows: &[u32]) -> Gaussians {
    Gaussians::from_tensors(
        take(gaussians.means.val().inner(), rows),
        take(gaussians.quats.val().inner(), rows),
        take(gaussians.log_scales.val().inner(), rows),
        take(gaussians.opacity_logits.val().inner(), rows),
        take(gaussians.sh.val().inner(), rows),
    )
}

/// The rows of a tensor, in this order; without rows an empty tensor.
pub(super) fn take<const D: usize>(tensor: Tensor<D>, rows: &[u32]) -> Tensor<D> {
    if rows.is_empty() {
        let mut shape = tensor.dims();
        shape[0] = 0;
        return Tensor::zeros(shape, (&tensor.device(), tensor.dtype()));
    }
    let index: Vec<i32> = rows.iter().map(|row| *row as i32).collect();
    let index: Tensor<1, Int> = Tensor::from_data(TensorData::new(index, [rows.len()]), &tensor.device());
    tensor.select(0, index)
}
