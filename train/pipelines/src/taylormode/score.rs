//! Score test of each row's own motion: would the photos have it leave the path of its body?
//!
//! A row without blocks of its own follows its body, and the gradients of its path say where it would go. Over the
//! photos of an epoch their sum `S` has the variance `V`, the sum of their squares about the mean, where nothing but
//! noise speaks; `S^2 / V` is then chi-squared (Rao's score test in its robust form, which needs neither a variance of
//! the photos' noise nor a second fit). What all rows of a body ask for together is the body's own step that is still
//! to come: the part `V_i [1, (x_i - centre) / scale] d` of `S_i`, with one `d` for the body by weighted least squares,
//! is taken out. A block earns its place where the sum over its three axes exceeds Schwarz's criterion. Not part of the
//! paper.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use gs_base::dense::solve;
use gs_burn::RowMap;
use gs_models::taylormode::TaylorMotion;

use gs_train::fit::parameters::to_host;

/// The gradients of rows since the last test.
#[derive(Module, Debug)]
pub struct Score {
    /// `[M, 3 (K + J)]`, their sum.
    pub sum: Param<Tensor<2>>,
    /// The same of their squares.
    pub square: Param<Tensor<2>>,
    /// Photos.
    pub photos: usize,
}

impl Score {
    /// No photo of the rows of `motion`.
    pub fn new(motion: &TaylorMotion, device: &Device) -> Self {
        let zeros = || Tensor::zeros([motion.len(), 3 * (motion.order() + motion.contacts().len())], device);
        Self { sum: Param::from_tensor(zeros()), square: Param::from_tensor(zeros()), photos: 0 }
    }

    /// With the gradients `[M, 3 (K + J)]` of one photo more.
    pub fn with(self, gradients: Tensor<2>) -> Self {
        let square = self.square.map(|square| square + gradients.clone().powi_scalar(2));
        Self { sum: self.sum.map(|sum| sum + gradients), square, photos: self.photos + 1 }
    }

    /// Follows a change of the rows.
    pub fn follow(self, own: &RowMap) -> Self {
        Self { sum: own.apply(self.sum), square: own.apply(self.square), ..self }
    }

    /// The rows of bodies whose blocks have earned their place get these as their own; `means` are the centres of all
    /// Gaussians at `t0`. Returns how many did.
    pub fn earn(&self, motion: &mut TaylorMotion, means: &[f32]) -> usize {
        let criterion = 3.0 * (self.photos.max(1) as f64).ln();
        let gradients = [to_host(self.sum.val()), to_host(self.square.val())];
        let mut earned = 0;
        for index in 0..motion.bodies.len() {
            let rows = motion.rows_of(index);
            let frame = motion.bodies[index].frame;
            let bases: Vec<[f64; 4]> =
                rows.iter().map(|row| frame.basis_at(&means[3 * motion.rows[*row] as usize..][..3])).collect();
            let statistics = self.statistics(&gradients, &rows, &bases, criterion);
            for (row, blocks) in rows.into_iter().zip(statistics) {
                let asked = |k: &usize| blocks[*k] > criterion;
                let order = (0..motion.order()).rev().find(asked).map_or(0, |k| k as u8 + 1);
                let jumps = (motion.order()..blocks.len()).any(|k| asked(&k));
                if order > motion.orders[row] || (jumps && !motion.own_jumps[row]) {
                    motion.orders[row] = order.max(motion.orders[row]);
                    motion.own_jumps[row] |= jumps;
                    earned += 1;
                }
            }
        }
        earned
    }

    /// For each of the `rows` of a body, whose bases are given, the statistic of each block, from the sums of all rows'
    /// gradients and of their squares.
    fn statistics(
        &self,
        [sum, square]: &[Vec<f32>; 2],
        rows: &[usize],
        bases: &[[f64; 4]],
        criterion: f64,
    ) -> Vec<Vec<f64>> {
        let (columns, photos) = (self.sum.dims()[1], self.photos.max(1) as f64);
        let mut statistics = vec![vec![0.0; columns / 3]; rows.len()];
        for k in 0..columns / 3 {
            let mut asks = vec![false; rows.len()];
            for _ in 0..FITS {
                let mut of_rows = vec![0.0; rows.len()];
                for column in 3 * k..3 * k + 3 {
                    let at = |row: usize| {
                        let (sum, square) = (sum[columns * row + column], square[columns * row + column]);
                        let (sum, square) = (f64::from(sum), f64::from(square));
                        // About their mean: what all photos ask for is no noise. One photo has no variance.
                        (sum, (square - sum * sum / photos).max(square / photos))
                    };
                    let common = common_step(rows.iter().map(|row| at(*row)), bases, &asks);
                    for ((statistic, row), basis) in of_rows.iter_mut().zip(rows).zip(bases) {
                        let (sum, square) = at(*row);
                        let expected: f64 = basis.iter().zip(&common).map(|(x, d)| x * d).sum();
                        *statistic += (sum - square * expected).powi(2) / square.max(f64::MIN_POSITIVE);
                    }
                }
                asks = of_rows.iter().map(|statistic| *statistic > criterion).collect();
                statistics.iter_mut().zip(of_rows).for_each(|(own, statistic)| own[k] = statistic);
            }
        }
        statistics
    }
}

/// Fits of what rows ask for together, each without the rows that asked for more in the one before.
const FITS: usize = 3;

/// Added to the diagonal of the normal equations, as a share of its sum: a direction in which the rows do not extend
/// gets no step.
const RIDGE: f64 = 1e-9;

/// The step `d` for which `V_i basis_i d` is nearest to the sums `S_i`, each with the variance `V_i`, over the rows
/// that do not `ask` for more.
fn common_step(scores: impl Iterator<Item = (f64, f64)>, bases: &[[f64; 4]], asks: &[bool]) -> Vec<f64> {
    let mut normal = vec![vec![0.0; 5]; 4];
    for ((sum, square), basis) in scores.zip(bases).zip(asks).filter(|(_, asks)| !**asks).map(|(one, _)| one) {
        for (i, equation) in normal.iter_mut().enumerate() {
            (0..4).for_each(|j| equation[j] += square * basis[i] * basis[j]);
            equation[4] += sum * basis[i];
        }
    }
    let ridge = RIDGE * (0..4).map(|i| normal[i][i]).sum::<f64>();
    (0..4).for_each(|i| normal[i][i] += ridge);
    solve(normal).unwrap_or_else(|| vec![0.0; 4])
}

#[cfg(test)]
mod tests {
    use burn::tensor::TensorData;
    use gs_models::taylormode::{BodyFrame, MotionFrame, TimeWindow};
    use gs_train::fit::random::{Purpose, stream};
    use rand::Rng;

    use super::*;

    const ROWS: usize = 60;
    const ORDER: usize = 3;
    const PHOTOS: usize = 150;

    /// Photos of rows that follow a body. All are pulled by what the body's next step will do, which every second one
    /// would take for its own; row 7 asks for order 2 beside, by half of the noise of a photo.
    #[test]
    fn a_row_earns_what_it_asks_for_beside_its_body() {
        let device = gs_burn::device::select("auto").expect("a device");
        let mut rng = stream(3, Purpose::Bench, 2);
        let means: Vec<f32> = (0..3 * ROWS).map(|_| rng.random_range(-1.0..1.0)).collect();
        let mut frame = MotionFrame::new((0..ROWS as u32).collect(), ORDER, 2, TimeWindow { t0: 0.0, half: 1.0 });
        frame.bodies = vec![BodyFrame { order: ORDER as u8, ..BodyFrame::new([0.0; 3], 1.0) }];
        frame.body_of.fill(0);
        frame.orders.fill(0);
        frame.rotation_orders.fill(0);
        let mut motion = frame.init(1, &device);
        let mut score = Score::new(&motion, &device);
        for _ in 0..PHOTOS {
            let mut gradients = vec![0.0_f32; ROWS * 3 * ORDER];
            for row in 0..ROWS {
                // Rows that many pixels show have large gradients and large noise.
                let noise = if row % 2 == 0 { 1.0 } else { 0.1 };
                let basis = frame.bodies[0].basis_at(&means[3 * row..][..3]);
                let common = 0.3 * (basis[0] - basis[1] + 0.5 * basis[3]) as f32 * noise * noise;
                for (column, gradient) in gradients[9 * row..][..9].iter_mut().enumerate() {
                    let own = if row == 7 && column == 4 { noise / 2.0 } else { 0.0 };
                    *gradient = noise * rng.random_range(-1.7..1.7) + common + own;
                }
            }
            let table = Tensor::from_data(TensorData::new(gradients, [ROWS, 3 * ORDER]), &device);
            score = score.with(table);
        }
        assert_eq!(score.photos, PHOTOS);
        let earned = score.earn(&mut motion, &means);
        assert_eq!(motion.orders[7], 2);
        // Of 180 blocks one in 500 exceeds the criterion by chance: more than two have a probability of 0.005.
        assert!((1..=3).contains(&earned) && motion.followers() == ROWS - earned, "{earned} rows");
    }
}
