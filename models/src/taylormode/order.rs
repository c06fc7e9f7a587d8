//! The polynomial order of each Gaussian's motion, and whether a higher one is worth its numbers.
//!
//! Order 0 is static; there is no other flag. A path is lowered by the polynomial of the next lower order that is
//! nearest to it over the window in the largest deviation: the one without the last of Chebyshev's polynomials
//! (economisation). A likelihood check on the photos decides between orders for a group of Gaussians; the remainder is
//! worth having only where the residuals have a pattern in time. Not part of the paper, which has one order for all.

use super::shrinkage::norm;
use super::window::{amplitude, at_centre};

/// Pixels of motion over half the window that nobody sees: a tenth of a pixel moves an edge of full contrast by a tenth
/// of that contrast in one row of pixels.
pub const NOTICEABLE: f64 = 0.1;

/// Residuals have a pattern in time when neighbours correlate by more than this many standard deviations of chance:
/// one white sequence in forty does.
const PATTERN: f64 = 2.0;

/// Lowers a path of blocks of three from `order` as long as all lowerings together move it by no more than `limit`
/// pixels, and returns the order that is left. Removed blocks are zero in `path`, and their contribution to the
/// constant goes to `centre`. NaN counts as motion: an order must not hide it.
pub fn lower(path: &mut [f32], mut order: usize, pixels_per_unit: f64, limit: f64, centre: &mut [f32; 3]) -> usize {
    let mut moved = 0.0;
    while order > 0 {
        moved += deviation(path, order) * pixels_per_unit;
        if moved.is_nan() || moved > limit {
            break;
        }
        economise(path, order, centre);
        order -= 1;
    }
    order
}

/// Largest deviation over the window of the path from the nearest of the next lower order, in the path's unit.
pub fn deviation(path: &[f32], order: usize) -> f64 {
    norm(block(path, order)) * amplitude(order)
}

/// Replaces the path of `order` by the nearest of the next lower order; its contribution to the constant goes to
/// `centre`.
pub fn economise(path: &mut [f32], order: usize, centre: &mut [f32; 3]) {
    let last = &mut path[3 * (order - 1)..][..3];
    for (value, part) in centre.iter_mut().zip(&mut *last) {
        *value -= *part * at_centre(order) as f32;
    }
    last.fill(0.0);
}

fn block(path: &[f32], order: usize) -> &[f32] {
    &path[3 * (order - 1)..][..3]
}

/// Residuals of two orders of the same Gaussians at the same pixels. Both orders are fitted, as the criterion assumes.
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
    /// Area over which the differences are correlated, pixels: the blur kernel's, at least 1. Neighbours that share a
    /// blur do not witness independently; counted one by one they would accept any order.
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
