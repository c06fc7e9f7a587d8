//! A polynomial through an object's centres over time, of the order that the data support.
//!
//! ```text
//! x(s) = sum_k c_k s^k,   s = (t - t0) / half  in [-1, 1] over the fitted times
//! BIC(p) = N ln(RSS_p / N) + 3 (p + 1) ln N,   N = 3 n coordinates of n centres; the order p with the least BIC
//! ```
//!
//! Least squares in f64 by an orthogonal basis (Gram-Schmidt, twice), so that no order loses digits to the monomials'
//! likeness on [-1, 1].

use glam::DVec3;

use super::guide::Centre;

/// Centres this many robust standard deviations off the highest order's curve are mistakes and do not count.
const OUTLIER: f64 = 6.0;

/// Rounds of reweighting towards least absolute distances.
const ROUNDS: usize = 30;

/// The median of |x| over the standard deviation, for normal x.
const MEDIAN_ABSOLUTE: f64 = 0.6745;

/// Least standard deviation of a coordinate that BIC believes in, as a share of the path's extent. Without it a path
/// free of noise would buy orders to explain rounding.
const DEVIATION_MIN: f64 = 1e-4;

/// Centres beyond the coefficients' number that a fit needs, so that there is a residual to judge it by.
const SPARE: usize = 1;

/// A centre's path as a polynomial in normalised time.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    /// Middle of the fitted times.
    pub t0: f64,
    /// Half of their range; s = (t - t0) / half.
    pub half: f64,
    /// `[order + 1]` coefficients of s^0, s^1, ..., scene units.
    pub coefficients: Vec<DVec3>,
    /// Root mean square distance of the centres from the curve, scene units.
    pub residual: f64,
    /// Centres that were left out as mistakes.
    pub outliers: usize,
}

impl Trajectory {
    /// Fits orders 0 to `max_order` (as far as the number of centres allows) and keeps the one with the least BIC.
    /// `None` without two centres at different finite times.
    pub fn fit(centres: &[Centre], max_order: usize) -> Option<Self> {
        let mut used: Vec<(f64, DVec3)> = centres
            .iter()
            .filter(|centre| centre.t.is_finite() && centre.position.is_finite())
            .map(|centre| (centre.t, centre.position))
            .collect();
        let low = used.iter().map(|(t, _)| *t).fold(f64::INFINITY, f64::min);
        let high = used.iter().map(|(t, _)| *t).fold(f64::NEG_INFINITY, f64::max);
        let (t0, half) = (0.5 * (low + high), 0.5 * (high - low));
        if used.len() < 2 || half.is_nan() || half <= 0.0 {
            return None;
        }
        used.iter_mut().for_each(|(t, _)| *t = (*t - t0) / half);
        let highest = |count: usize| max_order.min(count.saturating_sub(1 + SPARE));
        let before = used.len();
        drop_outliers(&mut used, highest(before));
        let floor = extent(&used) * DEVIATION_MIN;
        let count = 3.0 * used.len() as f64;
        let mut best: Option<(f64, Vec<DVec3>, f64)> = None;
        for order in 0..=highest(used.len()) {
            let coefficients = least_squares(&used, &vec![1.0; used.len()], order);
            let sum: f64 = used.iter().map(|(s, x)| evaluate(&coefficients, *s).distance_squared(*x)).sum();
            let variance = (sum / count).max(floor * floor).max(f64::MIN_POSITIVE);
            let bic = count * variance.ln() + 3.0 * (order as f64 + 1.0) * count.ln();
            if best.as_ref().is_none_or(|(least, ..)| bic < *least) {
                best = Some((bic, coefficients, (sum / used.len() as f64).sqrt()));
            }
        }
        let (_, coefficients, residual) = best?;
        Some(Self { t0, half, coefficients, residual, outliers: before - used.len() })
    }

    /// The chosen order; 0 is an object that does not move.
    pub fn order(&self) -> usize {
        self.coefficients.len() - 1
    }

    /// Place at a time. Outside the fitted times the path goes on straight: a polynomial would run away.
    pub fn position(&self, t: f64) -> DVec3 {
        let s = (t - self.t0) / self.half;
        let inside = s.clamp(-1.0, 1.0);
        evaluate(&self.coefficients, inside) + (s - inside) * evaluate(&derivative(&self.coefficients), inside)
    }

    /// Velocity at a time, scene units per unit of time; outside the fitted times that at their end.
    pub fn velocity(&self, t: f64) -> DVec3 {
        let s = ((t - self.t0) / self.half).clamp(-1.0, 1.0);
        evaluate(&derivative(&self.coefficients), s) / self.half
    }
}

fn evaluate(coefficients: &[DVec3], s: f64) -> DVec3 {
    coefficients.iter().rev().fold(DVec3::ZERO, |sum, coefficient| sum * s + *coefficient)
}

fn derivative(coefficients: &[DVec3]) -> Vec<DVec3> {
    coefficients.iter().enumerate().skip(1).map(|(k, coefficient)| k as f64 * *coefficient).collect()
}

/// The diagonal of the box around the places.
fn extent(points: &[(f64, DVec3)]) -> f64 {
    let low = points.iter().fold(DVec3::INFINITY, |low, (_, x)| low.min(*x));
    let high = points.iter().fold(DVec3::NEG_INFINITY, |high, (_, x)| high.max(*x));
    if points.is_empty() { 0.0 } else { low.distance(high) }
}

/// Removes centres far off the curve of the highest order. Judged by that one, because against a lower order the ends
/// of a bent path are far off too, and by least absolute distances, because a curve of least squares bends towards the
/// mistakes and hides them. At most a fifth goes, so that the curve cannot be bent to a few.
fn drop_outliers(points: &mut Vec<(f64, DVec3)>, order: usize) {
    let floor = (extent(points) * DEVIATION_MIN).max(f64::MIN_POSITIVE);
    let mut weights = vec![1.0; points.len()];
    let mut distances = Vec::new();
    for _ in 0..ROUNDS {
        let coefficients = least_squares(points, &weights, order);
        distances = points.iter().map(|(s, x)| evaluate(&coefficients, *s).distance(*x)).collect();
        weights.iter_mut().zip(&distances).for_each(|(weight, distance)| *weight = 1.0 / distance.max(floor));
    }
    let mut sorted: Vec<f64> = distances.clone();
    sorted.sort_by(f64::total_cmp);
    // The curve passes through as many centres as it has coefficients; they say nothing about the noise.
    let free = &sorted[(order + 1).min(sorted.len() - 1)..];
    let limit = OUTLIER * (free[free.len() / 2] / MEDIAN_ABSOLUTE).max(floor);
    let most_far = sorted[sorted.len() - 1 - sorted.len() / 5];
    let mut distances = distances.into_iter();
    points.retain(|_| distances.next().is_none_or(|distance| distance <= limit.max(most_far)));
}

/// Coefficients of the polynomial of an order that is closest to the points by weighted squares, `[order + 1]`.
fn least_squares(points: &[(f64, DVec3)], weights: &[f64], order: usize) -> Vec<DVec3> {
    // Weights relative to their mean, so that lengths below have a scale.
    let mean = weights.iter().sum::<f64>() / weights.len().max(1) as f64;
    let roots: Vec<f64> = weights.iter().map(|weight| (weight / mean).sqrt()).collect();
    let columns: Vec<Vec<f64>> = (0..=order)
        .map(|k| points.iter().zip(&roots).map(|((s, _), root)| root * s.powi(k as i32)).collect())
        .collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    // Columns = basis * upper, basis orthonormal.
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let mut upper = vec![vec![0.0; order + 1]; order + 1];
    for (k, column) in columns.iter().enumerate() {
        let mut rest = column.clone();
        // The second pass removes what rounding left of the first.
        for _ in 0..2 {
            for (row, known) in basis.iter().enumerate() {
                let part = dot(known, &rest);
                upper[row][k] += part;
                rest.iter_mut().zip(known).for_each(|(rest, known)| *rest -= part * known);
            }
        }
        let length = dot(&rest, &rest).sqrt();
        upper[k][k] = length;
        // A column that the others already span (repeated times) has no direction of its own: coefficient 0.
        let scale = if length > 1e-9 { 1.0 / length } else { 0.0 };
        basis.push(rest.iter().map(|value| value * scale).collect());
    }
    let mut coefficients = vec![DVec3::ZERO; order + 1];
    for k in (0..=order).rev() {
        let right: DVec3 = basis[k].iter().zip(&roots).zip(points).map(|((q, root), (_, x))| *q * *root * *x).sum();
        let known: DVec3 = (k + 1..=order).map(|j| upper[k][j] * coefficients[j]).sum();
        coefficients[k] = if upper[k][k] > 1e-9 { (right - known) / upper[k][k] } else { DVec3::ZERO };
    }
    coefficients
}
