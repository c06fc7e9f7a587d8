//! Solution of small dense systems by elimination with the largest pivot of each column.

/// The row from `column` on with the largest number there.
fn pivot(rows: &[Vec<f64>], column: usize) -> usize {
    let largest = (column..rows.len()).max_by(|a, b| rows[*a][column].abs().total_cmp(&rows[*b][column].abs()));
    largest.unwrap_or(column)
}

/// Gauss's elimination of `[A | b]`; `None` where `A` has no inverse.
pub fn solve(mut rows: Vec<Vec<f64>>) -> Option<Vec<f64>> {
    let count = rows.len();
    for column in 0..count {
        let pivot = pivot(&rows, column);
        rows.swap(column, pivot);
        if rows[column][column].abs() < f64::MIN_POSITIVE {
            return None;
        }
        let (above, below) = rows.split_at_mut(column + 1);
        let lead = &above[column];
        for row in below {
            let factor = row[column] / lead[column];
            row.iter_mut().zip(lead).skip(column).for_each(|(x, y)| *x -= factor * y);
        }
    }
    let mut solution = vec![0.0; count];
    for row in (0..count).rev() {
        let known: f64 = (row + 1..count).map(|column| rows[row][column] * solution[column]).sum();
        solution[row] = (rows[row][count] - known) / rows[row][row];
    }
    solution.iter().all(|x| x.is_finite()).then_some(solution)
}

/// Gauss and Jordan's elimination of `[A | B]`, `A` positive definite, `B` of `C` columns. It rounds otherwise than
/// [`solve`].
pub fn solve_columns<const C: usize>(mut rows: Vec<Vec<f64>>) -> Vec<[f64; C]> {
    let order = rows.len();
    for column in 0..order {
        let pivot = pivot(&rows, column);
        rows.swap(column, pivot);
        let lead = rows[column].clone();
        for (index, row) in rows.iter_mut().enumerate() {
            let factor = if index == column { 1.0 - 1.0 / lead[column] } else { row[column] / lead[column] };
            row.iter_mut().zip(&lead).for_each(|(entry, lead)| *entry -= factor * lead);
        }
    }
    rows.iter().map(|row| std::array::from_fn(|column| row[order + column])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_eliminations_find_the_solution() {
        let rows = vec![vec![0.0, 2.0, 1.0, 7.0], vec![2.0, 1.0, 0.0, 4.0], vec![1.0, 0.0, 3.0, 10.0]];
        let truth = [1.0, 2.0, 3.0];
        let found = [solve(rows.clone()).expect("one solution"), solve_columns::<1>(rows).into_flattened()];
        for found in found {
            assert!(found.iter().zip(truth).all(|(x, y)| (x - y).abs() < 1e-12), "{found:?}");
        }
        assert_eq!(solve(vec![vec![1.0, 2.0, 1.0], vec![2.0, 4.0, 1.0]]), None);
    }
}
