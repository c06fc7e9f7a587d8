//! Eigenvalues and eigenvectors of a small symmetric matrix by Jacobi's method: planes are turned until it is diagonal.

/// Makes the symmetric `matrix` `[N, N]` diagonal in `sweeps` sweeps over its planes: its eigenvalues are then on the
/// diagonal, and the columns of `vectors` `[N, N]`, whatever it held before, are their eigenvectors. Convergence is
/// quadratic.
pub fn diagonalise<R: AsMut<[f64]>>(matrix: &mut [R], vectors: &mut [R], sweeps: usize) {
    let count = matrix.len();
    for (index, row) in vectors.iter_mut().enumerate() {
        row.as_mut().fill(0.0);
        row.as_mut()[index] = 1.0;
    }
    for _ in 0..sweeps {
        for p in 0..count {
            for q in p + 1..count {
                let entry = matrix[p].as_mut()[q];
                if entry.abs() <= f64::MIN_POSITIVE {
                    continue;
                }
                let theta = 0.5 * (matrix[q].as_mut()[q] - matrix[p].as_mut()[p]) / entry;
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                turn(matrix, vectors, (p, q), (c, t * c));
            }
        }
    }
}

/// Turns rows and columns `p` and `q` of `matrix`, and columns of `vectors`, by the angle with cosine `c` and sine `s`.
fn turn<R: AsMut<[f64]>>(matrix: &mut [R], vectors: &mut [R], (p, q): (usize, usize), (c, s): (f64, f64)) {
    for row in matrix.iter_mut().chain(vectors) {
        let row = row.as_mut();
        let (a, b) = (row[p], row[q]);
        (row[p], row[q]) = (c * a - s * b, s * a + c * b);
    }
    for k in 0..matrix.len() {
        let (a, b) = (matrix[p].as_mut()[k], matrix[q].as_mut()[k]);
        (matrix[p].as_mut()[k], matrix[q].as_mut()[k]) = (c * a - s * b, s * a + c * b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvectors_make_the_matrix_again() {
        let whole = [[4.0, 1.0, -2.0], [1.0, 3.0, 0.5], [-2.0, 0.5, 1.0]];
        let (mut matrix, mut vectors) = (whole, [[7.0; 3]; 3]);
        diagonalise(&mut matrix, &mut vectors, 8);
        for i in 0..3 {
            for j in 0..3 {
                let entry: f64 = (0..3).map(|k| vectors[i][k] * matrix[k][k] * vectors[j][k]).sum();
                let product: f64 = (0..3).map(|k| vectors[k][i] * vectors[k][j]).sum();
                assert!((entry - whole[i][j]).abs() < 1e-13, "{entry} at {i}, {j}");
                assert!((product - f64::from(u8::from(i == j))).abs() < 1e-13, "columns {i} and {j}");
            }
        }
    }
}
