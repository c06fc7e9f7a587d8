//! The paths of moving Gaussians, to be asked at any time: Eq. 2 and its velocity, Eq. 3.
//!
//! `mu(t) = mu_0 + sum_{k=1..K} c_k s^k + R(s)`, `s = (t - t0) / half`, `c_k = f^(k) half^k / k!` `[3]`;
//! `v(t) = (sum_k k c_k s^(k-1) + R'(s)) / half`. The same sum is stored and learned as `sum_k b_k f_k(s)` with
//! [`polynomials`] `f_k` of order `k`, which act over the whole window: one learning rate suits all orders, whatever
//! the unit of time. Rotation has a series of its own, of the rotation vector ([`rotation`](crate::rotation)). Only the
//! rows listed move; the others cost nothing. Outside the window see [`window`](super::window).

use burn::tensor::{Int, Tensor, TensorData, assert_shape};
use gs_burn::ops::products::scaled;
use gs_burn::ops::rows::{add_rows, take_rows};
use gs_burn::{Gaussians, MovingSamples, exact_matmul, profile};

use super::kinks::Kinks;
use super::remainder::Remainder;
use super::window::{Sample, TimeWindow, polynomials, powers_of};
use crate::rotation::turn;

/// How `M` of a scene's `N` Gaussians move: [`TaylorMotion::paths`](super::TaylorMotion::paths) with the remainder's
/// network evaluated, which is worth doing once for all times.
#[derive(Debug, Clone)]
pub struct Paths {
    /// `[M]`, which Gaussians move; each at most once.
    pub rows: Tensor<1, Int>,
    /// `[M, 3 K]`, blocks `b_1 .. b_K` of three, scene units.
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

/// Times at which to move the Gaussians, through which a gradient may reach the times themselves.
#[derive(Debug, Clone)]
pub struct Instants {
    /// The data set's unit.
    pub times: Vec<f64>,
    /// How the times change together; `None`: not at all.
    pub shift: Option<Shift>,
}

/// A change of times that is zero in value: time `k` is `times[k] + rates[k] change`, so that the change gets the
/// loss's derivative. See [`Exposure::instants`](super::Exposure::instants).
#[derive(Debug, Clone)]
pub struct Shift {
    /// `[1]`, zero in value.
    pub change: Tensor<1>,
    /// One for each time.
    pub rates: Vec<f64>,
}

impl Instants {
    /// Number of times.
    pub fn len(&self) -> usize {
        self.times.len()
    }

    /// Whether there is no time.
    pub fn is_empty(&self) -> bool {
        self.times.is_empty()
    }
}

impl From<Vec<f64>> for Instants {
    fn from(times: Vec<f64>) -> Self {
        Self { times, shift: None }
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
        self.rotation_sums(&[t], |_, sample| sample.value)
    }

    fn position_sum(&self, t: f64, part: impl Fn(Sample) -> f64) -> Tensor<2> {
        self.position_sums(&[t], |_, sample| part(sample))
    }

    /// `[M, 3 n]`, a block of three for each of the `n` times.
    fn position_sums(&self, times: &[f64], part: impl Fn(usize, Sample) -> f64) -> Tensor<2> {
        let mut sum = series(&self.position, self.factors(times, |s| polynomials(s, self.order()), &part));
        if let Some(rest) = &self.remainder {
            sum = sum + series(&rest.weights, self.factors(times, |s| rest.functions(s), &part));
        }
        if let Some(kinks) = &self.kinks {
            sum = sum + series(&kinks.jumps.val(), self.factors(times, |s| kinks.functions(s), &part));
        }
        sum
    }

    /// Likewise of the rotation vector.
    fn rotation_sums(&self, times: &[f64], part: impl Fn(usize, Sample) -> f64) -> Tensor<2> {
        series(&self.rotation, self.factors(times, |s| polynomials(s, self.rotation_order()), part))
    }

    /// For each time, the factors of all blocks.
    fn factors(
        &self,
        times: &[f64],
        functions: impl Fn(f64) -> Vec<Sample>,
        part: impl Fn(usize, Sample) -> f64,
    ) -> Vec<Vec<f64>> {
        let one = |(k, t): (usize, &f64)| {
            functions(self.window.normalised(*t)).into_iter().map(|sample| part(k, sample)).collect()
        };
        times.iter().enumerate().map(one).collect()
    }

    /// Displacements and rotation vectors, `[M, 3 n]` each, with the gradient by the times where the instants ask for
    /// it.
    fn moved_by(&self, Instants { times, shift }: &Instants) -> (Tensor<2>, Tensor<2>) {
        let value = |_, sample: Sample| sample.value;
        let (displacement, rotation) = (self.position_sums(times, value), self.rotation_sums(times, value));
        let Some(Shift { change, rates }) = shift else { return (displacement, rotation) };
        let change = change.clone().cast(displacement.dtype());
        let by_change = |rate: Tensor<2>| -> Tensor<2> { scaled(change.clone(), rate.detach()).squeeze_dim(0) };
        let half = self.window.half;
        let slope = |k: usize, sample: Sample| rates[k] * sample.slope / half;
        let (velocity, turning) = (self.position_sums(times, slope), self.rotation_sums(times, slope));
        (displacement + by_change(velocity), rotation + by_change(turning))
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

    /// The scene at each of some instants, whose gradient reaches the times where they ask for it.
    pub fn scenes(&self, gaussians: &Gaussians, instants: &Instants) -> Vec<Gaussians> {
        let (means, quats) = (gaussians.means.val(), gaussians.quats.val());
        let MovingSamples { means: centres, quats: turned, .. } = self.samples(&means, &quats, instants);
        let count = self.len();
        // A row is replaced by adding its difference: its gradient then goes to the sample alone.
        let [still, unturned] = [&means, &quats].map(|all| take_rows(all.clone(), &self.rows));
        let replaced = |all: &Tensor<2>, moved: &Tensor<2>, own: &Tensor<2>, k: usize| {
            add_rows(all.clone(), &self.rows, moved.clone().narrow(0, k * count, count) - own.clone())
        };
        let scene = |k: usize| {
            let (means, quats) = match self.is_empty() {
                true => (means.clone(), quats.clone()),
                false => (replaced(&means, &centres, &still, k), replaced(&quats, &turned, &unturned, k)),
            };
            let (scales, opacities) = (gaussians.log_scales.val(), gaussians.opacity_logits.val());
            Gaussians::from_tensors(means, quats, scales, opacities, gaussians.sh.val())
        };
        (0..instants.len()).map(scene).collect()
    }

    /// Centres `[I M, 3]` and orientations `[I M, 4]` of the moving rows alone, from all rows at `t0` (`[N, 3]`, `[N,
    /// 4]`), at each of the `I` instants of an exposure, one after another. The number of operations does not depend on
    /// that of the instants.
    pub fn samples(&self, means: &Tensor<2>, quats: &Tensor<2>, instants: &Instants) -> MovingSamples {
        let _stage = profile::stage("motion samples");
        let (count, moving) = (instants.len(), self.len());
        if self.is_empty() {
            let none = |columns| Tensor::zeros([0, columns], (&means.device(), means.dtype()));
            return MovingSamples { instants: count, means: none(3), quats: none(4) };
        }
        let by_instant = |rows: Tensor<2>| -> Tensor<3> { rows.reshape([moving, count, 3]).swap_dims(0, 1) };
        let (displacement, rotation) = self.moved_by(instants);
        let means = by_instant(displacement) + take_rows(means.clone(), &self.rows).unsqueeze_dim(0);
        let own = take_rows(quats.clone(), &self.rows);
        let still: Tensor<3> = own.clone().unsqueeze_dim(0);
        let quats = match self.rotation_order() {
            0 => still.expand([count, moving, 4]),
            _ => turn(own, by_instant(rotation).reshape([count * moving, 3])).reshape([count, moving, 4]) + still,
        };
        MovingSamples {
            instants: count,
            means: means.reshape([count * moving, 3]),
            quats: quats.reshape([count * moving, 4]),
        }
    }
}

/// Blocks of Chebyshev's polynomials `[M, 3 K]` as Taylor's coefficients, blocks of the powers `s^1 .. s^K`.
pub(super) fn taylor_coefficients(blocks: &Tensor<2>) -> Tensor<2> {
    let order = blocks.dims()[1] / 3;
    let powers = powers_of(order);
    let factors = (0..order).map(|power| powers.iter().map(|p| p.get(power).copied().unwrap_or(0.0)).collect());
    series(blocks, factors.collect())
}

/// `sum_k factors[i][k] block_k` of `coefficients` `[M, 3 K]` for each `i` below `n`, `[M, 3 n]`.
fn series(coefficients: &Tensor<2>, factors: Vec<Vec<f64>>) -> Tensor<2> {
    let ([rows, columns], sums) = (coefficients.dims(), factors.len());
    let options = (&coefficients.device(), coefficients.dtype());
    if rows == 0 || columns == 0 {
        return Tensor::zeros([rows, 3 * sums], options);
    }
    // One product with a matrix of blocks f I instead of K slices, products and sums.
    let mut matrix = vec![0.0; columns * 3 * sums];
    for (i, factors) in factors.into_iter().enumerate() {
        assert_shape!(coefficients, [rows, 3 * factors.len()]);
        for (k, factor) in factors.into_iter().enumerate() {
            (0..3).for_each(|axis| matrix[(3 * k + axis) * 3 * sums + 3 * i + axis] = factor);
        }
    }
    exact_matmul(coefficients.clone(), Tensor::from_data(TensorData::new(matrix, [columns, 3 * sums]), options))
}
