//! Structural similarity over Gaussian windows of 11 x 11 pixels with standard deviation 1.5 (Wang et al. 2004), on the
//! host and in doubles.

use std::ops::Range;

use burn::tensor::Tensor;
use gs_kernels::constants::{SSIM_C1, SSIM_C2, SSIM_SIGMA, SSIM_WINDOW};
use rayon::prelude::*;

/// Pixels from a window's middle to its edge.
const REACH: usize = SSIM_WINDOW / 2;

/// Rows that are looked at at once: the work space of a thread is a few hundred rows, and the rows around a band that
/// are averaged twice are a twelfth.
const BAND: usize = 128;

/// The pixels beyond the border of an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Border {
    /// The image reflected at its first and last pixel; sides above [`REACH`].
    Reflected,
    /// Zeros, as in 3DGS.
    Zero,
}

impl Border {
    /// The position in `0..length` of position `index - REACH`; `None` where a zero stands.
    fn position(self, index: usize, length: usize) -> Option<usize> {
        match self {
            Self::Zero => index.checked_sub(REACH).filter(|position| *position < length),
            Self::Reflected => {
                let from_first = index.abs_diff(REACH);
                Some(if from_first < length { from_first } else { 2 * (length - 1) - from_first })
            }
        }
    }
}

/// One channel of an image, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Plane {
    /// Pixels of a row.
    pub width: usize,
    /// The pixels.
    pub values: Vec<f64>,
}

impl Plane {
    /// The channels of an image `[H, W, C]`, made one after the other: planes of doubles are large.
    pub fn channels(image: Tensor<3>) -> impl Iterator<Item = Self> {
        let [_, width, channels] = image.dims();
        let values: Vec<f32> = image.into_data().iter::<f32>().collect();
        (0..channels).map(move |channel| Self {
            width,
            values: values.iter().skip(channel).step_by(channels).map(|x| f64::from(*x)).collect(),
        })
    }

    fn height(&self) -> usize {
        self.values.len() / self.width
    }

    /// The means of blocks of 2 x 2 pixels; a last odd row or column is dropped.
    pub fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height() / 2);
        let mean = |i: usize| {
            let first = 2 * (i / width) * self.width + 2 * (i % width);
            let below = first + self.width;
            (self.values[first] + self.values[first + 1] + self.values[below] + self.values[below + 1]) / 4.0
        };
        Self { width, values: (0..width * height).map(mean).collect() }
    }
}

/// A measure at every pixel, and its mean.
#[derive(Debug, Clone, Copy)]
pub struct Similarity {
    /// Whether luminance is in it, beside contrast and structure.
    pub luminance: bool,
    /// The pixels beyond the border.
    pub border: Border,
}

impl Similarity {
    /// The mean over the pixels, each with its weight in `weights` where that is given; `None` where all weights are 0.
    pub fn mean(&self, x: &Plane, y: &Plane, weights: Option<&Plane>) -> Option<f64> {
        let (width, height) = (x.width, x.height());
        let window = window();
        let of_band = |first: usize| {
            let rows = first..(first + BAND).min(height);
            let blurred =
                |product: &(dyn Fn(usize) -> f64 + Sync)| self.blurred(product, (width, height), &rows, &window);
            let [mean_x, mean_y] = [x, y].map(|plane| blurred(&|i| plane.values[i]));
            let squares = [(x, x), (y, y), (x, y)].map(|(a, b)| blurred(&|i| a.values[i] * b.values[i]));
            let pixels = (0..rows.len() * width).map(|i| {
                let value = self.of_pixel([mean_x[i], mean_y[i], squares[0][i], squares[1][i], squares[2][i]]);
                let weight = weights.map_or(1.0, |plane| plane.values[first * width + i]);
                [weight * value, weight]
            });
            pixels.fold([0.0; 2], |[sum, all], [value, weight]| [sum + value, all + weight])
        };
        let bands: Vec<[f64; 2]> = (0..height).into_par_iter().step_by(BAND).map(of_band).collect();
        let [sum, all] = bands.iter().fold([0.0; 2], |[a, b], [value, weight]| [a + value, b + weight]);
        (all > 0.0).then(|| sum / all)
    }

    fn of_pixel(&self, [mx, my, square_x, square_y, both]: [f64; 5]) -> f64 {
        let variances = (square_x - mx * mx).max(0.0) + (square_y - my * my).max(0.0);
        let structure = (2.0 * (both - mx * my) + SSIM_C2) / (variances + SSIM_C2);
        let luminance = if self.luminance { (2.0 * mx * my + SSIM_C1) / (mx * mx + my * my + SSIM_C1) } else { 1.0 };
        luminance * structure
    }

    /// Some rows of an image whose pixels `value_of` gives, averaged by the window: along rows, then along columns.
    fn blurred(
        &self,
        value_of: &(dyn Fn(usize) -> f64 + Sync),
        (width, height): (usize, usize),
        rows: &Range<usize>,
        window: &[f64; SSIM_WINDOW],
    ) -> Vec<f64> {
        // Row `index` of these is the row at position `rows.start + index` of the image with its border.
        let mut along = vec![0.0; (rows.len() + 2 * REACH) * width];
        let mut row = vec![0.0; width + 2 * REACH];
        for (index, target) in along.chunks_exact_mut(width).enumerate() {
            let Some(source) = self.border.position(rows.start + index, height) else { continue };
            let value = |i| self.border.position(i, width).map_or(0.0, |x| value_of(source * width + x));
            row.iter_mut().enumerate().for_each(|(i, x)| *x = value(i));
            target.iter_mut().zip(row.windows(window.len())).for_each(|(x, values)| *x = weighted(window, values));
        }
        let mut values = vec![0.0; rows.len() * width];
        for (y, target) in values.chunks_exact_mut(width).enumerate() {
            for (i, weight) in window.iter().enumerate() {
                let source = &along[(y + i) * width..][..width];
                target.iter_mut().zip(source).for_each(|(x, value)| *x += weight * value);
            }
        }
        values
    }
}

fn weighted(window: &[f64], values: &[f64]) -> f64 {
    window.iter().zip(values).map(|(weight, value)| weight * value).sum()
}

/// The window's weights along one axis; they add up to 1.
fn window() -> [f64; SSIM_WINDOW] {
    let weights = std::array::from_fn(|i| (-(i as f64 - REACH as f64).powi(2) / (2.0 * SSIM_SIGMA * SSIM_SIGMA)).exp());
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}
