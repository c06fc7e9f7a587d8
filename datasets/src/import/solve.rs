//! Sums of squares of a few hundred unknowns: normal equations and their solution.

/// Normal equations `matrix * x = right` of weighted rows.
pub(super) struct Normal {
    count: usize,
    /// `[count, count]`, symmetric; the lower triangle is kept.
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl Normal {
    pub fn new(count: usize) -> Self {
        Self { count, matrix: vec![0.0; count * count], right: vec![0.0; count] }
    }

    /// Adds `weight * (sum of slope * x + residual)^2`. An unknown may stand in several terms.
    pub fn add(&mut self, terms: &[(usize, f64)], residual: f64, weight: f64) {
        for (row, slope) in terms {
            self.right[*row] -= weight * slope * residual;
            for (column, other) in terms.iter().filter(|(column, _)| column <= row) {
                self.matrix[row * self.count + column] += weight * slope * other;
            }
        }
    }

    /// The minimum, by Cholesky's method; `None` where it is not one point.
    pub fn solve(mut self) -> Option<Vec<f64>> {
        let n = self.count;
        for row in 0..n {
            for column in 0..=row {
                let product = |k: usize| self.matrix[row * n + k] * self.matrix[column * n + k];
                let rest = self.matrix[row * n + column] - (0..column).map(product).sum::<f64>();
                self.matrix[row * n + column] = match row == column {
                    true if rest > 0.0 => rest.sqrt(),
                    true => return None,
                    false => rest / self.matrix[column * n + column],
                };
            }
        }
        let mut x = self.right;
        for row in 0..n {
            let known: f64 = (0..row).map(|k| self.matrix[row * n + k] * x[k]).sum();
            x[row] = (x[row] - known) / self.matrix[row * n + row];
        }
        for row in (0..n).rev() {
            let known: f64 = (row + 1..n).map(|k| self.matrix[k * n + row] * x[k]).sum();
            x[row] = (x[row] - known) / self.matrix[row * n + row];
        }
        x.iter().all(|value| value.is_finite()).then_some(x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_points_is_found() {
        let mut normal = Normal::new(2);
        // y = 3 x - 2 in three points, with other weights; the residual of a row is minus its y.
        for (x, weight) in [(0.0, 1.0), (1.0, 5.0), (4.0, 0.5)] {
            normal.add(&[(0, x), (1, 1.0)], -(3.0 * x - 2.0), weight);
        }
        let solved = normal.solve().expect("a solution");
        assert!((solved[0] - 3.0).abs() < 1e-12 && (solved[1] + 2.0).abs() < 1e-12, "{solved:?}");
        let mut flat = Normal::new(2);
        flat.add(&[(0, 1.0), (1, 1.0)], 1.0, 1.0);
        assert!(flat.solve().is_none(), "one row leaves a direction free");
    }
}
