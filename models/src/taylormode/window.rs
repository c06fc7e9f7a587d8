//! The stretch of time a Taylor series is meant for, and how it continues outside.
//!
//! All times become `s = (t - t0) / half`: -1 to 1 inside the window. Outside, a polynomial of order `n` runs away as
//! `|s|^n`, and one that fits the window best extrapolates worst. So past the edge each basis function returns, within
//! [`FADE`], to its own best straight line over the window (least squares, uniform in `s`), as a model of order
//! 1 would have learned there, and then goes on at constant velocity. Position and velocity stay continuous, order 1 is
//! not changed at all, and no order can extrapolate much worse than order 1.

use serde::{Deserialize, Serialize};

use crate::basis::{Past, TimeFunction};

/// Over which stretch of `s` past the edge a function returns to its straight line; the same for all, so that what
/// cancels between the powers at the edge keeps cancelling. Shorter, and the velocity jerks at the edge; longer, and a
/// steep edge carries the Gaussian away before it turns: a slope `d` at the edge, relative to the line, adds at most
/// `4/27 FADE d`. With 0.5 orders 2 to 5 fitted to a bounce extrapolate up to 21 % worse than order 1, with 0.25 up to
/// 5 %.
pub const FADE: f64 = 0.25;

/// A window of time `[t0 - half, t0 + half]`, in the data set's unit; as JSON to the bit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TimeWindow {
    /// The time of the expansion: the stored Gaussians are those of `t0`.
    #[serde(with = "crate::bits")]
    pub t0: f64,
    /// Half the window's length, positive.
    #[serde(with = "crate::bits")]
    pub half: f64,
}

/// A function of time and its derivative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// The value.
    pub value: f64,
    /// Its derivative by `s`.
    pub slope: f64,
}

impl TimeWindow {
    /// `t` in units of the window: 0 at `t0`, -1 and 1 at the edges.
    pub fn normalised(&self, t: f64) -> f64 {
        (t - self.t0) / self.half
    }
}

/// The functions `(T_k(s) - T_k(0)) / k`, `k = 1..=order`, continued past the window, `T_k` Chebyshev's polynomials.
///
/// They span the powers `s^k` of Eq. 2 (see [`powers_of`]) and are zero at `t0` as those are. A block of any order
/// moves its Gaussian over the whole window, and no two look alike; high powers act at the window's ends alone, where
/// each is nearly the next. With the factor `1 / k` a step of one length changes the velocity by as much at any order:
/// what one photo says of a path is noise to the others, and the blur shows velocities.
pub fn polynomials(s: f64, order: usize) -> Vec<Sample> {
    let one = |k: usize| {
        let shifted = move |s: f64| {
            let Sample { value, slope } = chebyshev(k, s);
            Sample { value: value * amplitude(k) - at_centre(k), slope: slope * amplitude(k) }
        };
        continued(s, || polynomial_line(k), shifted)
    };
    (1..=order).map(one).collect()
}

/// `T_k(s)`, by `T_{k+1} = 2 s T_k - T_{k-1}`.
fn chebyshev(k: usize, s: f64) -> Sample {
    let (mut before, mut now) = (Sample { value: 1.0, slope: 0.0 }, Sample { value: s, slope: 1.0 });
    for _ in 0..k {
        let next = Sample {
            value: 2.0 * s * now.value - before.value,
            slope: 2.0 * now.value + 2.0 * s * now.slope - before.slope,
        };
        (before, now) = (now, next);
    }
    before
}

/// How far a block of order `k`, from 1, deviates from its mean position over the window, in lengths of the block.
pub fn amplitude(k: usize) -> f64 {
    1.0 / k as f64
}

/// `T_k(0) / k`, `k` from 1.
pub fn at_centre(k: usize) -> f64 {
    [1.0, 0.0, -1.0, 0.0][k % 4] * amplitude(k)
}

/// The best line `[value at 0, slope]` to `(T_k(s) - T_k(0)) / k`, least squares over the window. `T_n` of even `n` has
/// the integral `2 / (1 - n^2)`, and `s T_k = (T_{k+1} + T_{k-1}) / 2`.
fn polynomial_line(k: usize) -> [f64; 2] {
    let integral = |n: usize| 2.0 * amplitude(k) / (1.0 - (n * n) as f64);
    match k.is_multiple_of(2) {
        true => [0.5 * integral(k) - at_centre(k), 0.0],
        false => [0.0, 0.75 * (integral(k + 1) + integral(k - 1))],
    }
}

/// The coefficients by power, from the first on, of each of [`polynomials`]: Taylor's coefficients are the blocks'
/// sums with these factors.
pub fn powers_of(order: usize) -> Vec<Vec<f64>> {
    let mut polynomials = vec![vec![1.0], vec![0.0, 1.0]];
    for k in 1..order {
        let mut next = vec![0.0; k + 2];
        polynomials[k].iter().enumerate().for_each(|(power, c)| next[power + 1] += 2.0 * c);
        polynomials[k - 1].iter().enumerate().for_each(|(power, c)| next[power] -= c);
        polynomials.push(next);
    }
    let by_power = |(k, polynomial): (usize, Vec<f64>)| polynomial[1..].iter().map(|c| c * amplitude(k)).collect();
    polynomials.into_iter().enumerate().skip(1).take(order).map(by_power).collect()
}

/// The powers `s^k`, `k = 1..=order`, continued past the window, for readers without this module.
pub fn described_powers(order: usize) -> Vec<TimeFunction> {
    let one = |k: usize| {
        let past = Past { line: power_line(k), fade: FADE };
        TimeFunction { past: Some(past), ..TimeFunction::power(k as u32) }
    };
    (1..=order).map(one).collect()
}

/// The best line a + b s to `s^k` in the least squares sense: odd powers have only b, even ones only a.
fn power_line(k: usize) -> [f64; 2] {
    if k.is_multiple_of(2) { [1.0 / (k + 1) as f64, 0.0] } else { [0.0, 3.0 / (k + 2) as f64] }
}

/// `function` at `s` inside the window; outside, its return to `line` (value at 0, slope).
pub fn continued(s: f64, line: impl FnOnce() -> [f64; 2], function: impl Fn(f64) -> Sample) -> Sample {
    if s.abs() <= 1.0 || s.is_nan() {
        return function(s);
    }
    let [offset, slope] = line();
    let mut result = Sample { value: offset + slope * s, slope };
    let edge = s.signum();
    let past = (s.abs() - 1.0) / FADE;
    if past < 1.0 {
        let at_edge = function(edge);
        let excess = at_edge.value - (offset + slope * edge);
        // Outwards, per FADE.
        let drift = (at_edge.slope - slope) * edge * FADE;
        // Hermite's cubics: from (excess, drift) at 0 to rest at 1.
        let x = past;
        result.value += excess * (1.0 + x * x * (2.0 * x - 3.0)) + drift * x * (1.0 - x) * (1.0 - x);
        let outward = excess * 6.0 * x * (x - 1.0) + drift * (1.0 - x) * (1.0 - 3.0 * x);
        result.slope += outward * edge / FADE;
    }
    result
}

/// The best line `[value at 0, slope]` to `function` over the window, least squares: its first two Legendre
/// coefficients, by Simpson's rule.
pub fn best_line(function: impl Fn(f64) -> f64) -> [f64; 2] {
    /// Enough for a few oscillations in the window to 1e-9.
    const INTERVALS: usize = 512;
    let mut line = [0.0; 2];
    for i in 0..=INTERVALS {
        let s = 2.0 * i as f64 / INTERVALS as f64 - 1.0;
        let weight = if i == 0 || i == INTERVALS { 1.0 } else { [2.0, 4.0][i % 2] } * 2.0 / (3.0 * INTERVALS as f64);
        let value = function(s);
        line[0] += weight * value / 2.0;
        line[1] += weight * value * s * 1.5;
    }
    line
}
