//! Weighted least squares in f64 over any functions of time, three coordinates at once.

use glam::DVec3;

/// Lengths under this, of columns of about unit length, are rounding.
const ROUNDING: f64 = 1e-9;

/// Coefficients of the `columns` (each a function at all points) whose sum is closest to `targets` by weighted squares. By
/// an orthogonal basis (Gram-Schmidt, twice), so that no order loses digits to the monomials' likeness on [-1, 1].
pub(crate) fn least_squares(columns: &[Vec<f64>], targets: &[DVec3], weights: &[f64]) -> Vec<DVec3> {
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
pub(crate) fn combined(columns: &[Vec<f64>], coefficients: &[DVec3], point: usize) -> DVec3 {
    columns.iter().zip(coefficients).map(|(column, coefficient)| column[point] * *coefficient).sum()
}
