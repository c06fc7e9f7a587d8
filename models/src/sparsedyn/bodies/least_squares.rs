//! Small dense least squares.

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

/// Gauss's elimination with the largest pivot in each column; the last column is the right side.
fn solve(mut matrix: Vec<Vec<f64>>) -> Option<Vec<f64>> {
    let count = matrix.len();
    for column in 0..count {
        let pivot = (column..count).max_by(|a, b| matrix[*a][column].abs().total_cmp(&matrix[*b][column].abs()))?;
        matrix.swap(column, pivot);
        if matrix[column][column].abs() < f64::MIN_POSITIVE {
            return None;
        }
        let (above, below) = matrix.split_at_mut(column + 1);
        let lead = &above[column];
        for row in below {
            let factor = row[column] / lead[column];
            row.iter_mut().zip(lead).skip(column).for_each(|(x, y)| *x -= factor * y);
        }
    }
    let mut solution = vec![0.0; count];
    for row in (0..count).rev() {
        let known: f64 = (row + 1..count).map(|column| matrix[row][column] * solution[column]).sum();
        solution[row] = (matrix[row][count] - known) / matrix[row][row];
    }
    solution.iter().all(|x| x.is_finite()).then_some(solution)
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
