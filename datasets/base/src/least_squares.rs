//! Linear least squares in f64, three coordinates at once.
//!
//! ```text
//! minimise sum_i w_i |sum_k a_k(i) c_k - x_i|^2 over the coefficients c_k
//! ```
//!
//! Columns are made orthonormal (Gram-Schmidt, twice) instead of solving the normal equations, so that no digits are
//! lost to the likeness of monomials on [-1, 1], and a column that the samples say nothing about needs no ridge: its
//! coefficient is 0.

use glam::DVec3;

/// Lengths under this, of columns of about unit length, are rounding.
const ROUNDING: f64 = 1e-9;

/// `[columns]` coefficients of the least squares fit to `targets` (`[samples]`). Each column holds one function at all
/// samples, `[samples]` values of about unit size. A column within the span of those before it (or of zeros) has the
/// coefficient 0.
///
/// ```
/// use glam::DVec3;
/// use gs_base::least_squares::least_squares;
///
/// let times = [-1.0, 0.0, 1.0_f64];
/// let columns = [times.map(|_| 1.0).to_vec(), times.to_vec(), vec![0.0; 3]];
/// let line = times.map(|t| DVec3::new(2.0, 3.0 * t, 0.0));
/// let found = least_squares(&columns, &line);
/// assert!(found[0].distance(DVec3::new(2.0, 0.0, 0.0)) < 1e-12);
/// assert!(found[1].distance(DVec3::new(0.0, 3.0, 0.0)) < 1e-12);
/// assert_eq!(found[2], DVec3::ZERO);
/// ```
///
/// # Panics
/// If a column has another length than `targets`.
pub fn least_squares(columns: &[Vec<f64>], targets: &[DVec3]) -> Vec<DVec3> {
    weighted_least_squares(columns, targets, &vec![1.0; targets.len()])
}

/// [`least_squares`] with a weight of at least 0 for each sample's squared distance; only their ratios count.
///
/// # Panics
/// If a column or `weights` have another length than `targets`.
pub fn weighted_least_squares(columns: &[Vec<f64>], targets: &[DVec3], weights: &[f64]) -> Vec<DVec3> {
    let fits = |length: usize| length == targets.len();
    assert!(
        columns.iter().all(|column| fits(column.len())) && fits(weights.len()),
        "a value and a weight for each target"
    );
    // Weights relative to their mean, so that lengths below have a scale.
    let mean = weights.iter().sum::<f64>() / weights.len().max(1) as f64;
    let roots: Vec<f64> = weights.iter().map(|weight| (weight / mean).sqrt()).collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    // Columns = basis * upper, basis orthonormal.
    let count = columns.len();
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let mut upper = vec![vec![0.0; count]; count];
    for (k, column) in columns.iter().enumerate() {
        let mut rest: Vec<f64> = column.iter().zip(&roots).map(|(value, root)| value * root).collect();
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
        let scale = if length > ROUNDING { 1.0 / length } else { 0.0 };
        basis.push(rest.iter().map(|value| value * scale).collect());
    }
    let mut coefficients = vec![DVec3::ZERO; count];
    for k in (0..count).rev() {
        let right: DVec3 = basis[k].iter().zip(&roots).zip(targets).map(|((q, root), x)| *q * *root * *x).sum();
        let known: DVec3 = (k + 1..count).map(|j| upper[k][j] * coefficients[j]).sum();
        coefficients[k] = if upper[k][k] > ROUNDING { (right - known) / upper[k][k] } else { DVec3::ZERO };
    }
    coefficients
}

/// The sum of the columns at one point.
pub fn combined(columns: &[Vec<f64>], coefficients: &[DVec3], point: usize) -> DVec3 {
    columns.iter().zip(coefficients).map(|(column, coefficient)| column[point] * *coefficient).sum()
}
