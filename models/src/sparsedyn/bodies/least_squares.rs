//! Small dense least squares.

use gs_base::dense::solve;
use gs_burn::glam::DVec3;

/// The solution of `(J^T J + damping diag) x = J^T r`, columns of `J` given.
pub(super) fn damped(columns: &[Vec<f64>], residuals: &[f64], damping: f64) -> Option<Vec<f64>> {
    let mut matrix = normal(columns, damping);
    matrix.iter_mut().zip(columns).for_each(|(row, column)| row.push(dot(column, residuals)));
    solve(matrix)
}

/// Rows `w_k` of which `x_k = w_k r` is that solution for any `r`: for many of them.
pub(super) fn solver(columns: &[Vec<f64>], damping: f64) -> Option<Vec<Vec<f64>>> {
    let matrix = normal(columns, damping);
    let inverse = |k: usize| {
        let mut matrix = matrix.clone();
        matrix.iter_mut().enumerate().for_each(|(i, row)| row.push(if i == k { 1.0 } else { 0.0 }));
        solve(matrix)
    };
    let count = columns.first().map_or(0, Vec::len);
    let row = |own: Vec<f64>| -> Vec<f64> {
        (0..count).map(|at| own.iter().zip(columns).map(|(x, column)| x * column[at]).sum()).collect()
    };
    // The matrix is symmetric, and so is its inverse.
    (0..columns.len()).map(|k| inverse(k).map(row)).collect()
}

/// `J^T J + damping diag`.
fn normal(columns: &[Vec<f64>], damping: f64) -> Vec<Vec<f64>> {
    let row = |a: &Vec<f64>| columns.iter().map(|b| dot(a, b)).collect();
    let mut matrix: Vec<Vec<f64>> = columns.iter().map(row).collect();
    let largest = (0..columns.len()).map(|i| matrix[i][i]).fold(0.0, f64::max);
    for (i, row) in matrix.iter_mut().enumerate() {
        row[i] += damping * row[i].max(1e-9 * largest) + f64::MIN_POSITIVE;
    }
    matrix
}

/// The sum of products.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The vectors `x_k` that fit `sum_k column_k x_k` best to `data`; zero where the columns say nothing.
pub(super) fn linear(columns: &[Vec<f64>], data: &[DVec3]) -> Vec<DVec3> {
    let mut found = vec![DVec3::ZERO; columns.len()];
    for axis in 0..3 {
        let values: Vec<f64> = data.iter().map(|vector| vector[axis]).collect();
        // A share of rounding keeps columns that are alike apart.
        if let Some(solution) = damped(columns, &values, 1e-12) {
            found.iter_mut().zip(solution).for_each(|(vector, x)| vector[axis] = x);
        }
    }
    found
}
