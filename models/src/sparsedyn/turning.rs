//! Rotation of positions by a rotation vector, and the translation of a screw motion, on rows.
//!
//! For a rotation vector `r` of length `a`: `Exp(r) u = u + A r x u + B r x (r x u)`, and the integral
//! `int_0^1 Exp(s r) ds u = u + B r x u + C r x (r x u)`, with `A = sin(a) / a`, `B = (1 - cos a) / a^2`, `C = (a - sin
//! a) / a^3`.

use burn::tensor::Tensor;

/// Squared angle below which the three factors are summed as power series: above it the formulas lose less than two
/// digits to cancellation, below it the series of six terms is exact to 1e-13.
const SERIES_BELOW: f64 = 0.25;

/// The factors `A`, `B` and `C` of a rotation vector, `[M, 1]` each.
#[derive(Debug, Clone)]
pub struct Factors {
    sine: Tensor<2>,
    cosine: Tensor<2>,
    rest: Tensor<2>,
}

impl Factors {
    /// The factors of rotation vectors `[M, 3]`, radians. Smooth everywhere, zero included.
    pub fn of(rotation: &Tensor<2>) -> Self {
        let squared = rotation.clone().square().sum_dim(1);
        let is_small = squared.clone().lower_elem(SERIES_BELOW);
        // The floor keeps the unused branch, and so its gradient, finite.
        let large = squared.clone().clamp_min(SERIES_BELOW);
        let angle = large.clone().sqrt();
        let (sine, cosine) = (angle.clone().sin(), angle.clone().cos());
        let choose = |closed: Tensor<2>, first: f64| {
            closed.mask_where(is_small.clone(), series(squared.clone().clamp_max(SERIES_BELOW), first))
        };
        Self {
            sine: choose(sine.clone() / angle.clone(), 1.0),
            cosine: choose((cosine.neg() + 1.0) / large.clone(), 2.0),
            rest: choose((angle.clone() - sine) / (large * angle), 3.0),
        }
    }

    /// `Exp(r) u - u`, `[M, 3]`.
    pub fn turned_by(&self, rotation: &Tensor<2>, u: &Tensor<2>) -> Tensor<2> {
        combined(&self.sine, &self.cosine, rotation, u)
    }

    /// `int_0^1 Exp(s r) ds u - u`, `[M, 3]`.
    pub fn integrated(&self, rotation: &Tensor<2>, u: &Tensor<2>) -> Tensor<2> {
        combined(&self.cosine, &self.rest, rotation, u)
    }
}

fn combined(first: &Tensor<2>, second: &Tensor<2>, rotation: &Tensor<2>, u: &Tensor<2>) -> Tensor<2> {
    let once = rotation.clone().cross(u.clone(), 1);
    let twice = rotation.clone().cross(once.clone(), 1);
    once * first.clone() + twice * second.clone()
}

/// `sum_k (-s)^k / (2k + from)!` times `1`: with `from` 1, 2 and 3 the series of `A`, `B` and `C` in the squared angle
/// `s`.
fn series(squared: Tensor<2>, from: f64) -> Tensor<2> {
    const TERMS: usize = 6;
    let mut factor = 1.0 / (1..=from as usize).map(|k| k as f64).product::<f64>();
    let mut coefficients = Vec::with_capacity(TERMS);
    for k in 0..TERMS {
        coefficients.push(factor);
        let next = 2.0 * k as f64 + from;
        factor *= -1.0 / ((next + 1.0) * (next + 2.0));
    }
    let last = squared.zeros_like() + coefficients[TERMS - 1];
    coefficients[..TERMS - 1].iter().rev().fold(last, |sum, coefficient| sum * squared.clone() + *coefficient)
}
