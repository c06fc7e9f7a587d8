//! How much motion each Gaussian has: its polynomial order, and whether a higher one is worth its numbers.
//!
//! Order 0 is static; there is no other flag. The order is what [`shrinkage`](super::shrinkage) left above
//! [`NOTICEABLE`]; a likelihood check on the photos decides between orders for a group of Gaussians; the remainder is
//! worth having only where what is left over has a pattern in time. Not part of the paper, which has one order for all.

use burn::tensor::{Int, Tensor, TensorData};

use super::taylor_motion::{TaylorMotion, resized};

/// Pixels of motion over half the window that nobody sees: a tenth of a pixel moves an edge of full contrast by a tenth
/// of that contrast in one row of pixels.
pub const NOTICEABLE: f64 = 0.1;

/// Residuals have a pattern in time when neighbours correlate by more than this many standard deviations of chance:
/// one white sequence in forty does.
const PATTERN: f64 = 2.0;

/// The orders `0..=K` of Gaussians with `coefficients` `[M, 3 K]`, row by row: the lowest at which all that is left out
/// stays below [`NOTICEABLE`] pixels together. `pixels_per_unit` has one entry per row, see
/// [`pixels_per_unit`](super::shrinkage::pixels_per_unit); for rotations, times the Gaussian's largest standard
/// deviation, which is how far its rim moves per radian.
///
/// # Panics
/// When the lengths do not fit together.
pub fn orders(coefficients: &[f32], pixels_per_unit: &[f32]) -> Vec<usize> {
    let rows = pixels_per_unit.len();
    if rows == 0 || coefficients.is_empty() {
        return vec![0; rows];
    }
    assert!(coefficients.len().is_multiple_of(3 * rows), "{} coefficients for {rows} rows", coefficients.len());
    let columns = coefficients.len() / rows;
    let one = |(row, scale): (&[f32], &f32)| {
        let pixels = |block: &[f32]| {
            let squared: f64 = block.iter().map(|x| f64::from(*x).powi(2)).sum();
            squared.sqrt() * f64::from(*scale)
        };
        let blocks: Vec<f64> = row.chunks_exact(3).map(pixels).collect();
        let mut left_out = 0.0;
        let noticed = |(_, block): &(usize, &f64)| {
            left_out += **block;
            // Not a number counts as motion: an order must not hide it.
            left_out.is_nan() || left_out >= NOTICEABLE
        };
        blocks.iter().enumerate().rev().find(noticed).map_or(0, |(k, _)| k + 1)
    };
    coefficients.chunks_exact(columns).zip(pixels_per_unit).map(one).collect()
}

/// Motion without what nobody sees.
#[derive(Debug, Clone)]
pub struct Pruned {
    /// The rest: rows that still move, blocks above each row's order zero, columns above the highest order gone. No
    /// remainder; ask its network again.
    pub motion: TaylorMotion,
    /// Which rows of the motion before these are.
    pub kept: Vec<u32>,
    /// Orders of the position, one per row kept.
    pub position_orders: Vec<usize>,
    /// Orders of the rotation, one per row kept.
    pub rotation_orders: Vec<usize>,
}

/// `motion` cut down to the given orders, one per row each ([`orders`]).
///
/// # Panics
/// When there is not one order a row.
pub fn prune(motion: &TaylorMotion, position_orders: &[usize], rotation_orders: &[usize]) -> Pruned {
    let rows = motion.len();
    assert_eq!([position_orders.len(), rotation_orders.len()], [rows, rows], "one order a row");
    let moves = |row: &usize| position_orders[*row] > 0 || rotation_orders[*row] > 0;
    let kept: Vec<usize> = (0..rows).filter(moves).collect();
    let of_kept = |orders: &[usize]| -> Vec<usize> { kept.iter().map(|row| orders[*row]).collect() };
    let (position_orders, rotation_orders) = (of_kept(position_orders), of_kept(rotation_orders));
    let highest = |orders: &[usize]| orders.iter().max().copied().unwrap_or(0);
    let index: Vec<i32> = kept.iter().map(|row| *row as i32).collect();
    let index = Tensor::from_data(TensorData::new(index, [kept.len()]), &motion.position.device());
    let cut = |tensor: &Tensor<2>, orders: &[usize]| {
        let order = highest(orders).min(tensor.dims()[1] / 3);
        cut_to(resized(tensor, 3 * order), &index, orders)
    };
    let motion = TaylorMotion {
        // Selecting nothing is not something every backend does.
        rows: if kept.is_empty() { index.clone() } else { motion.rows.clone().select(0, index.clone()) },
        position: cut(&motion.position, &position_orders),
        rotation: cut(&motion.rotation, &rotation_orders),
        window: motion.window,
        remainder: None,
    };
    Pruned { motion, kept: kept.into_iter().map(|row| row as u32).collect(), position_orders, rotation_orders }
}

/// Rows `index` of `coefficients`, with the blocks above each one's order zero.
fn cut_to(coefficients: Tensor<2>, index: &Tensor<1, Int>, orders: &[usize]) -> Tensor<2> {
    let columns = coefficients.dims()[1];
    let options = (&coefficients.device(), coefficients.dtype());
    if orders.is_empty() || columns == 0 {
        return Tensor::zeros([orders.len(), columns], options);
    }
    let inside = |order: &usize| (0..columns).map(move |c| if c < 3 * order { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
    let mask: Vec<f64> = orders.iter().flat_map(inside).collect();
    let mask = Tensor::from_data(TensorData::new(mask, [orders.len(), columns]), options);
    coefficients.select(0, index.clone()) * mask
}

/// What two orders of the same Gaussians make of the same held-out pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// Sum of squared colour differences with the lower order.
    pub lower: f64,
    /// The same with the higher order.
    pub higher: f64,
    /// Variance of one colour difference when the model is right.
    pub variance: f64,
    /// How many differences were summed.
    pub pixels: f64,
    /// Area over which they are correlated, pixels: that of the blur kernel, at least 1. Neighbours that share a blur
    /// do not witness independently; counted one by one they would accept any order.
    pub blur_area: f64,
    /// How many numbers the higher order has more.
    pub parameters: f64,
}

impl Evidence {
    /// Whether the higher order is worth its numbers (Schwarz 1978): twice the gain in log-likelihood exceeds
    /// `parameters * ln(n)`, with gain and `n` counted in independent pixels, `pixels / blur_area`.
    pub fn accepts(&self) -> bool {
        let area = self.blur_area.max(1.0);
        let independent = self.pixels / area;
        let twice_gain = (self.lower - self.higher) / (self.variance * area);
        independent > 1.0 && twice_gain > self.parameters * independent.ln()
    }
}

/// Whether residuals of one thing at successive times have a pattern that a remainder could learn: their correlation
/// with their neighbours in time is beyond chance. Sequences shorter than 4 tell nothing.
pub fn has_pattern(residuals: &[[f64; 3]]) -> bool {
    let count = residuals.len();
    if count < 4 {
        return false;
    }
    let n = count as f64;
    let axes = [0, 1, 2].map(|axis| {
        let mean = residuals.iter().map(|r| r[axis]).sum::<f64>() / n;
        let centred: Vec<f64> = residuals.iter().map(|r| r[axis] - mean).collect();
        let neighbours = centred.windows(2).map(|pair| pair[0] * pair[1]).sum::<f64>();
        (centred.iter().map(|x| x * x).sum::<f64>(), neighbours)
    });
    let power: f64 = axes.iter().map(|axis| axis.0).sum();
    let correlation = axes.iter().map(|axis| axis.1).sum::<f64>() / power;
    // Chance: mean -1 / n, since the mean was taken out; variance 1 / n, over the number of axes that take part.
    let concentration = axes.iter().map(|axis| (axis.0 / power).powi(2)).sum::<f64>();
    power > 0.0 && correlation + 1.0 / n > PATTERN * (concentration / n).sqrt()
}
