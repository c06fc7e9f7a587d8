//! How far the members of an ensemble are apart: the uncertainty of each Gaussian's position.

use gs_base::median;
use gs_models::DynamicScene;
use serde::Serialize;

use gs_train::fit::parameters::to_host;
use gs_train::fit::times::{TIMES_AT_ONCE, through_time};

/// Fewest members: of one there is no spread.
pub const FEWEST: usize = 2;

/// The spread of each Gaussian at several times.
#[derive(Debug, Clone, PartialEq)]
pub struct Spread {
    /// The times.
    pub times: Vec<f64>,
    /// `[T][N]` scene units: the root mean square distance of the members' positions from their mean, with one degree
    /// of freedom taken for the mean.
    pub values: Vec<Vec<f32>>,
}

/// The spread over moving Gaussians at a time, scene units.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SpreadAt {
    /// The time.
    pub time: f64,
    /// Over moving Gaussians.
    pub median: f64,
    /// The root mean square.
    pub rms: f64,
}

impl Spread {
    /// The spread of `members`, at least [`FEWEST`], at `times`.
    pub fn of(members: &[Box<dyn DynamicScene>], times: &[f64]) -> Self {
        let mut values = Vec::with_capacity(times.len());
        for times in times.chunks(TIMES_AT_ONCE) {
            let mut sums: Vec<Sums> = Vec::new();
            for member in members {
                for (index, gaussians) in member.at_times(times).into_iter().enumerate() {
                    let positions = to_host(gaussians.means.val());
                    match sums.get_mut(index) {
                        Some(sums) => sums.add(&positions),
                        None => sums.push(Sums::new(positions)),
                    }
                }
            }
            values.extend(sums.iter().map(|sums| sums.spread(members.len())));
        }
        Self { times: times.to_vec(), values }
    }

    /// A summary for each time over the Gaussians of `rows`.
    pub fn summary(&self, rows: &[u32]) -> Vec<SpreadAt> {
        let at = |(time, values): (&f64, &Vec<f32>)| {
            let own: Vec<f64> = rows.iter().map(|row| f64::from(values[*row as usize])).collect();
            let rms = (own.iter().map(|x| x * x).sum::<f64>() / own.len().max(1) as f64).sqrt();
            SpreadAt { time: *time, median: median(own).unwrap_or(0.0), rms }
        };
        self.times.iter().zip(&self.values).map(at).collect()
    }
}

/// Sums of the differences from the first member: a large position does not cancel a small spread.
struct Sums {
    first: Vec<f32>,
    differences: Vec<f64>,
    squares: Vec<f64>,
}

impl Sums {
    fn new(first: Vec<f32>) -> Self {
        Self { differences: vec![0.0; first.len()], squares: vec![0.0; first.len() / 3], first }
    }

    fn add(&mut self, positions: &[f32]) {
        for (index, (position, first)) in positions.iter().zip(&self.first).enumerate() {
            let difference = f64::from(*position) - f64::from(*first);
            self.differences[index] += difference;
            self.squares[index / 3] += difference * difference;
        }
    }

    fn spread(&self, members: usize) -> Vec<f32> {
        let count = members as f64;
        let of = |(sum, squares): (&[f64], &f64)| {
            let mean: f64 = sum.iter().map(|x| x * x).sum::<f64>() / count;
            ((squares - mean).max(0.0) / (count - 1.0)).sqrt() as f32
        };
        self.differences.chunks_exact(3).zip(&self.squares).map(of).collect()
    }
}

/// The Gaussians that move by more than `least` scene units between any two of `times` and the first of them.
pub fn moving_rows(scene: &dyn DynamicScene, times: &[f64], least: f64) -> Vec<u32> {
    let mut at = through_time(scene, times).map(|gaussians| to_host(gaussians.means.val()));
    let Some(first) = at.next() else { return Vec::new() };
    let mut moves = vec![false; first.len() / 3];
    for positions in at {
        let rows = positions.chunks_exact(3).zip(first.chunks_exact(3));
        for (moves, (a, b)) in moves.iter_mut().zip(rows) {
            let squared: f64 = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum();
            *moves |= squared > least * least;
        }
    }
    moves.iter().enumerate().filter(|(_, moves)| **moves).map(|(row, _)| row as u32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_is_the_deviation_from_the_mean() {
        let mut sums = Sums::new(vec![1e6, 0.0, 0.0]);
        sums.add(&[1e6 + 1.0, 0.0, 0.0]);
        sums.add(&[1e6 + 2.0, 0.0, 0.0]);
        // Positions 0, 1 and 2: squares 1 + 0 + 1 over two degrees of freedom.
        assert_eq!(sums.spread(3), [1.0]);
        let still = Sums::new(vec![3.0; 3]);
        assert_eq!(still.spread(2), [0.0]);
    }
}
