//! Small dense least squares.

use gs_base::dense::solve;
use gs_burn::glam::DVec3;

/// The solution of `(J^T J + damping diag) x = J^T r`, columns of `J` given.
pub(super) fn damped(columns: &[Vec<f64>], residuals: &[f64], damping: f64) -> Option<Vec<f64>> {
    let mut matrix = normal(columns, damping);
    matrix.iter_mut().zip(columns).for_each(|(row, column)| row.push(dot(column, residuals)));
    solve(matrix)
}

/// Relative step of a derivative by differences: its error is then some 1e-9 of it.
const DIFFERENCE: f64 = 1e-6;

/// Most steps of [`descent`]: laws of one oscillation converge in about 15.
const STEPS: usize = 40;

/// Damping of its first step, the least and the most.
const DAMPING: [f64; 3] = [1e-3, 1e-12, 1e9];

/// Levenberg and Marquardt's method, derivatives by differences: `numbers` moved to where the squares of `residuals`
/// are least. `held` keeps numbers to what holds between them. It ends when a step gains less than the share
/// `converged`.
pub(super) fn descent(
    numbers: Vec<f64>,
    held: impl Fn(Vec<f64>) -> Vec<f64>,
    residuals: impl Fn(&[f64]) -> Vec<f64>,
    converged: f64,
) -> Vec<f64> {
    let squared = |residuals: &[f64]| residuals.iter().map(|x| x * x).sum::<f64>();
    let mut numbers = held(numbers);
    let mut base = residuals(&numbers);
    let [mut damping, least, most] = DAMPING;
    for _ in 0..STEPS {
        let sum = squared(&base);
        if numbers.is_empty() || sum == 0.0 || damping > most {
            break;
        }
        let column = |k: usize| -> Vec<f64> {
            let mut moved = numbers.clone();
            let h = DIFFERENCE * moved[k].abs().max(1.0);
            moved[k] += h;
            residuals(&held(moved)).iter().zip(&base).map(|(after, before)| (after - before) / h).collect()
        };
        let columns: Vec<Vec<f64>> = (0..numbers.len()).map(column).collect();
        let Some(change) = damped(&columns, &base, damping) else { break };
        let next = held(numbers.iter().zip(change).map(|(x, by)| x - by).collect());
        let after = residuals(&next);
        let left = squared(&after);
        if left < sum {
            (numbers, base) = (next, after);
            damping = (0.3 * damping).max(least);
            if 1.0 - left / sum < converged {
                break;
            }
        } else {
            damping *= 10.0;
        }
    }
    numbers
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
