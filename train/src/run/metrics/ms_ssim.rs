//! Multi-scale structural similarity (Wang, Simoncelli and Bovik 2003, equation 7).
//!
//! `MS-SSIM = l_M^b_M prod_j cs_j^b_j`, where `cs_j` is the mean of contrast times structure at scale `j`, `l_M` takes luminance in at
//! the coarsest, and each scale has half of the size of the one before. Windows are Gaussians of 11 x 11 pixels; images are continued
//! by reflection. The result is the mean over the channels.

use std::ops::Range;

use burn::tensor::Tensor;
use rayon::prelude::*;

/// The exponents `b_j` of the five scales (section 3.2).
const WEIGHTS: [f64; 5] = [0.0448, 0.2856, 0.3001, 0.2363, 0.1333];

/// Pixels from a window's middle to its edge.
const REACH: usize = 5;

/// Standard deviation of the window, pixels.
const SIGMA: f64 = 1.5;

/// Constants against division by zero, for values from 0 to 1: (0.01)^2 and (0.03)^2 of SSIM.
const C1: f64 = 1e-4;
const C2: f64 = 9e-4;

/// Rows that are looked at at once: the work space of a thread is a few hundred rows, and the rows around a band that are averaged twice
/// are a twelfth.
const BAND: usize = 128;

/// Least side of an image: at the fifth scale it is as large as the window, 11 pixels.
const SMALLEST: usize = (2 * REACH + 1) << (WEIGHTS.len() - 1);

/// Multi-scale SSIM of images `[H, W, 3]` with values from 0 to 1, 0 to 1; `None` if a side is under 176 pixels, at which the fifth
/// scale is smaller than the window.
pub fn ms_ssim(image: Tensor<3>, truth: Tensor<3>) -> Option<f64> {
    let [height, width, channels] = image.dims();
    if height.min(width) < SMALLEST {
        return None;
    }
    let host = |image: Tensor<3>| image.into_data().iter::<f32>().collect::<Vec<f32>>();
    let (image, truth) = (host(image), host(truth));
    let plane = |values: &[f32], channel: usize| Plane {
        width,
        values: values.iter().skip(channel).step_by(channels).map(|x| f64::from(*x)).collect(),
    };
    // One channel after the other: its planes of doubles are as large as the image.
    let parts: f64 = (0..channels).map(|channel| of_planes(plane(&image, channel), plane(&truth, channel))).sum();
    Some(parts / channels as f64)
}

/// One channel of an image, rows from the top.
struct Plane {
    width: usize,
    values: Vec<f64>,
}

fn of_planes(mut x: Plane, mut y: Plane) -> f64 {
    let mut product = 1.0;
    for (scale, weight) in WEIGHTS.iter().enumerate() {
        let coarsest = scale + 1 == WEIGHTS.len();
        product *= similarity(&x, &y, coarsest).max(0.0).powf(*weight);
        if !coarsest {
            (x, y) = (x.halved(), y.halved());
        }
    }
    product
}

/// The mean of contrast times structure, of luminance too where `with_luminance`.
fn similarity(x: &Plane, y: &Plane, with_luminance: bool) -> f64 {
    let (width, height) = (x.width, x.height());
    let window = window();
    let of_pixel = |[mx, my, square_x, square_y, both]: [f64; 5]| {
        let variances = (square_x - mx * mx).max(0.0) + (square_y - my * my).max(0.0);
        let structure = (2.0 * (both - mx * my) + C2) / (variances + C2);
        let luminance = if with_luminance { (2.0 * mx * my + C1) / (mx * mx + my * my + C1) } else { 1.0 };
        luminance * structure
    };
    let of_band = |first: usize| {
        let rows = first..(first + BAND).min(height);
        let blurred = |product: &(dyn Fn(usize) -> f64 + Sync)| blurred(product, (width, height), &rows, &window);
        let [mean_x, mean_y] = [x, y].map(|plane| blurred(&|i| plane.values[i]));
        let squares = [(x, x), (y, y), (x, y)].map(|(a, b)| blurred(&|i| a.values[i] * b.values[i]));
        let pixels = (0..rows.len() * width)
            .map(|i| of_pixel([mean_x[i], mean_y[i], squares[0][i], squares[1][i], squares[2][i]]));
        pixels.sum::<f64>()
    };
    let bands: Vec<f64> = (0..height).into_par_iter().step_by(BAND).map(of_band).collect();
    bands.iter().sum::<f64>() / x.values.len() as f64
}

/// Some rows of an image whose pixels `value_of` gives, averaged by the window: along rows, then along columns.
fn blurred(
    value_of: &(dyn Fn(usize) -> f64 + Sync),
    (width, height): (usize, usize),
    rows: &Range<usize>,
    window: &[f64; 2 * REACH + 1],
) -> Vec<f64> {
    // Row `index` of these is row `reflected(rows.start + index)` of the image.
    let mut along = vec![0.0; (rows.len() + 2 * REACH) * width];
    let mut row = vec![0.0; width + 2 * REACH];
    for (index, target) in along.chunks_exact_mut(width).enumerate() {
        let start = reflected(rows.start + index, height) * width;
        row.iter_mut().enumerate().for_each(|(i, x)| *x = value_of(start + reflected(i, width)));
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

impl Plane {
    fn height(&self) -> usize {
        self.values.len() / self.width
    }

    /// The means of blocks of 2 x 2 pixels; a last odd row or column is dropped.
    fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height() / 2);
        let mean = |i: usize| {
            let first = 2 * (i / width) * self.width + 2 * (i % width);
            let below = first + self.width;
            (self.values[first] + self.values[first + 1] + self.values[below] + self.values[below + 1]) / 4.0
        };
        Self { width, values: (0..width * height).map(mean).collect() }
    }
}

fn weighted(window: &[f64], values: &[f64]) -> f64 {
    window.iter().zip(values).map(|(weight, value)| weight * value).sum()
}

/// The window's weights along one axis; they add up to 1.
fn window() -> [f64; 2 * REACH + 1] {
    let weights = std::array::from_fn(|i| (-(i as f64 - REACH as f64).powi(2) / (2.0 * SIGMA * SIGMA)).exp());
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

/// The position in `0..length` of position `index - REACH`, continued by reflection at the first and the last; `length` above `REACH`.
fn reflected(index: usize, length: usize) -> usize {
    let from_first = index.abs_diff(REACH);
    if from_first < length { from_first } else { 2 * (length - 1) - from_first }
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, TensorData};

    use super::*;

    fn image(height: usize, width: usize, value: impl Fn(usize, usize, usize) -> f64) -> Tensor<3> {
        let values: Vec<f32> =
            (0..height * width * 3).map(|i| value(i / 3 / width, i / 3 % width, i % 3) as f32).collect();
        Tensor::from_data(TensorData::new(values, [height, width, 3]), &Device::flex())
    }

    fn waves(y: usize, x: usize, channel: usize) -> f64 {
        let (y, x) = (y as f64, x as f64);
        0.5 + 0.2 * (0.7 * x + 0.2 * y).sin() + 0.2 * (0.05 * x * (1.0 + channel as f64) - 0.09 * y).cos()
    }

    fn noisy(y: usize, x: usize, channel: usize) -> f64 {
        let hash = (y * 7919 + x * 104_729 + channel * 1_299_709) % 1009;
        (waves(y, x, channel) + 0.2 * (hash as f64 / 1009.0 - 0.5)).clamp(0.0, 1.0)
    }

    #[test]
    fn small_images_have_none() {
        let small = image(SMALLEST, SMALLEST - 1, waves);
        assert_eq!(ms_ssim(small.clone(), small), None);
    }

    /// Equal images have 1 at every scale; a constant shift leaves contrast and structure as they are, so that luminance of the coarsest
    /// scale is all that changes.
    #[test]
    fn equal_images_have_one_and_a_shift_costs_luminance_alone() {
        let flat = |level: f64| image(176, 180, move |_, _, _| level);
        let same = ms_ssim(flat(0.3), flat(0.3)).expect("large enough");
        assert!((same - 1.0).abs() < 1e-12, "{same}");
        // Images are f32.
        let [a, b] = [0.3_f32, 0.6].map(f64::from);
        let expected = ((2.0 * a * b + C1) / (a * a + b * b + C1)).powf(WEIGHTS[4]);
        let shifted = ms_ssim(flat(a), flat(b)).expect("large enough");
        assert!((shifted - expected).abs() < 1e-9, "{shifted}, not {expected}");
    }

    /// burn-train computes in f32: variances of 0.04 are differences of means of squares of about 0.3, so each term is right to 1e-6.
    #[cfg(feature = "lpips")]
    #[test]
    fn burn_train_has_the_same_value() {
        use burn::data::dataloader::Progress;
        use burn_train::metric::vision::{MsSsimInput, MsSsimMetric, MsSsimMetricConfig};
        use burn_train::metric::{Metric, MetricMetadata, Numeric};

        let (a, b) = (image(177, 201, waves), image(177, 201, noisy));
        let batch = |image: &Tensor<3>| image.clone().permute([2, 0, 1]).unsqueeze::<4>();
        let mut metric = MsSsimMetric::new(MsSsimMetricConfig::new(1.0), &Device::flex());
        let one = Progress { items_processed: 1, items_total: 1, unit: None };
        let metadata = MetricMetadata { progress: one, iteration: None, lr: None };
        metric.update(&MsSsimInput::new(batch(&a), batch(&b)), &metadata).expect("images of one size");
        let expected = metric.value().expect("a value").current();
        let own = ms_ssim(a, b).expect("large enough");
        assert!((own - expected).abs() < 1e-4, "{own}, not {expected}");
        assert!((0.05..0.995).contains(&own), "{own} tells nothing apart");
    }

    /// The value of a second implementation of the same formulas, in NumPy with doubles; sines of two libraries differ by 1e-16, and
    /// pixels rounded to f32 by 6e-8 where that crosses a rounding edge.
    #[test]
    fn the_value_of_a_second_implementation_is_met() {
        let own = ms_ssim(image(177, 201, waves), image(177, 201, noisy)).expect("large enough");
        assert!((own - 0.986_589_599).abs() < 1e-7, "{own}");
    }
}
