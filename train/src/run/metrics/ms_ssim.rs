//! Multi-scale structural similarity (Wang, Simoncelli and Bovik 2003, equation 7).
//!
//! `MS-SSIM = l_M^b_M prod_j cs_j^b_j`, where `cs_j` is the mean of contrast times structure at scale `j`, `l_M` takes
//! luminance in at the coarsest, and each scale has half of the size of the one before. Windows are Gaussians of 11 x
//! 11 pixels; images are continued by reflection. The result is the mean over the channels.

use burn::tensor::Tensor;
use gs_kernels::constants::SSIM_WINDOW;

use super::windows::{Border, Plane, Similarity};

/// The exponents `b_j` of the five scales (section 3.2).
const WEIGHTS: [f64; 5] = [0.0448, 0.2856, 0.3001, 0.2363, 0.1333];

/// Least side of an image: at the fifth scale it is as large as the window, 11 pixels.
const SMALLEST: usize = SSIM_WINDOW << (WEIGHTS.len() - 1);

/// Multi-scale SSIM of images `[H, W, 3]` with values from 0 to 1, 0 to 1; `None` if a side is under 176 pixels, at
/// which the fifth scale is smaller than the window. With `counts`, `[H, W, 1]`, each scale is a mean over the pixels
/// at which that is 1.
pub fn ms_ssim(image: Tensor<3>, truth: Tensor<3>, counts: Option<Tensor<3>>) -> Option<f64> {
    let [height, width, channels] = image.dims();
    if height.min(width) < SMALLEST {
        return None;
    }
    let counts = counts.and_then(|counts| Plane::channels(counts).next());
    let planes = Plane::channels(image).zip(Plane::channels(truth));
    Some(planes.map(|(x, y)| of_planes(x, y, counts.clone())).sum::<f64>() / channels as f64)
}

fn of_planes(mut x: Plane, mut y: Plane, mut counts: Option<Plane>) -> f64 {
    let mut product = 1.0;
    for (scale, weight) in WEIGHTS.iter().enumerate() {
        let coarsest = scale + 1 == WEIGHTS.len();
        let similarity = Similarity { luminance: coarsest, border: Border::Reflected };
        // Halving drops a last odd row or column. A scale to which no pixel that counts is left says nothing.
        let mean = similarity.mean(&x, &y, counts.as_ref()).unwrap_or(1.0);
        product *= mean.max(0.0).powf(*weight);
        if !coarsest {
            (x, y, counts) = (x.halved(), y.halved(), counts.map(|counts| counts.halved()));
        }
    }
    product
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, TensorData};
    use gs_kernels::constants::SSIM_C1 as C1;

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
        assert_eq!(ms_ssim(small.clone(), small, None), None);
    }

    /// Equal images have 1 at every scale; a constant shift leaves contrast and structure as they are, so that
    /// luminance of the coarsest scale is all that changes.
    #[test]
    fn equal_images_have_one_and_a_shift_costs_luminance_alone() {
        let flat = |level: f64| image(176, 180, move |_, _, _| level);
        let same = ms_ssim(flat(0.3), flat(0.3), None).expect("large enough");
        assert!((same - 1.0).abs() < 1e-12, "{same}");
        // Images are f32.
        let [a, b] = [0.3_f32, 0.6].map(f64::from);
        let expected = ((2.0 * a * b + C1) / (a * a + b * b + C1)).powf(WEIGHTS[4]);
        let shifted = ms_ssim(flat(a), flat(b), None).expect("large enough");
        assert!((shifted - expected).abs() < 1e-9, "{shifted}, not {expected}");
    }

    /// burn-train computes in f32: variances of 0.04 are differences of means of squares of about 0.3, so each term is
    /// right to 1e-6.
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
        let own = ms_ssim(a, b, None).expect("large enough");
        assert!((own - expected).abs() < 1e-4, "{own}, not {expected}");
        assert!((0.05..0.995).contains(&own), "{own} tells nothing apart");
    }

    /// The value of a second implementation of the same formulas, in NumPy with doubles; sines of two libraries differ
    /// by 1e-16, and pixels rounded to f32 by 6e-8 where that crosses a rounding edge.
    #[test]
    fn the_value_of_a_second_implementation_is_met() {
        let own = ms_ssim(image(177, 201, waves), image(177, 201, noisy), None).expect("large enough");
        assert!((own - 0.986_589_599).abs() < 1e-7, "{own}");
    }

    /// Pixels that do not count change nothing beyond the windows that reach them, however large the part of the image
    /// that they take: errors in a quarter of the image are the result of that quarter, and not of the image with three
    /// perfect ones.
    #[test]
    fn a_mask_is_no_dilution() {
        let (height, width) = (352, 352);
        let in_quarter = |y: usize, x: usize| y < 176 && x < 176;
        let wrong = |y: usize, x: usize, c: usize| if in_quarter(y, x) { noisy(y, x, c) } else { waves(y, x, c) };
        let counts = image(height, width, |y, x, _| f64::from(u8::from(in_quarter(y, x)))).narrow(2, 0, 1);
        let of = |counts| ms_ssim(image(height, width, waves), image(height, width, wrong), counts).expect("large");
        let quarter = ms_ssim(image(176, 176, waves), image(176, 176, noisy), None).expect("large enough");
        let (whole, masked) = (of(None), of(Some(counts)));
        assert!((masked - quarter).abs() < 0.25 * (whole - quarter), "{masked}, {quarter} and {whole}");
    }
}
