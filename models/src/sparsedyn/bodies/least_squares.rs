//! Small dense least squares.

use gs_base::dense::solve;
use gs_burn::glam::DVec3;

/// The solution of `(J^T J + damping diag) x = J^T r`, columns of `J` given.
pub(super) fn damped(columns: &[Vec<f64>], residuals: &[f64], damping: f64) -> Option<Vec<f64>> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let count = columns.len();
    let mut matrix = vec![vec![0.0; count + 1]; count];
    for i in 0..count {
        for j in 0..count {
            matrix[i][j] = dot(&columns[i], &columns[j]);
        }
        matrix[i][count] = dot(&columns[i], residuals);
    }
    let largest = (0..count).map(|i| matrix[i][i]).fold(0.0, f64::max);
    for (i, row) in matrix.iter_mut().enumerate() {
        row[i] += damping * row[i].max(1e-9 * largest) + f64::MIN_POSITIVE;
    }
    solve(matrix)
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
