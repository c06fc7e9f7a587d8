//! Image quality: PSNR, SSIM by this workspace's kernels, MS-SSIM, and LPIPS by burn-train in a build with the feature
//! `lpips`.
//!
//! Images are `[H, W, 3]` and are clamped to 0 to 1 first, as in 3DGS. SSIM is the 11x11 Gaussian-window SSIM with zero
//! padding of 3DGS; MS-SSIM has the five scales of Wang et al. 2003.

pub mod color_fit;
mod lpips;
mod ms_ssim;
mod windows;

use std::borrow::Borrow;

use burn::tensor::Tensor;
use gs_burn::ops::ssim::l1_ssim;

use windows::{Border, Plane, Similarity};

pub use lpips::{NO_LPIPS, Perceptual};
pub use ms_ssim::ms_ssim;

/// The PSNR of equal images, dB: an error of a thousandth of a step of 8 bits has it too.
const PSNR_MAX: f64 = 100.0;

/// Peak signal-to-noise ratio in dB, peak 1; `PSNR_MAX` for equal images.
pub fn psnr(image: Tensor<3>, truth: Tensor<3>) -> f64 {
    let difference = image - truth;
    let mse: f32 = (difference.clone() * difference).mean().into_scalar();
    psnr_of_mse(f64::from(mse))
}

/// PSNR over the pixels whose mask `[H, W, 1]` is 1.
pub fn psnr_masked(image: Tensor<3>, truth: Tensor<3>, mask: Tensor<3>) -> f64 {
    let difference = (image - truth) * mask.clone();
    let squares: f32 = (difference.clone() * difference).sum().into_scalar();
    let pixels: f32 = mask.sum().into_scalar();
    psnr_of_mse(f64::from(squares) / (3.0 * f64::from(pixels).max(1.0)))
}

/// The mean; `None` without values.
pub fn mean<T: Borrow<f64>>(values: impl IntoIterator<Item = T>) -> Option<f64> {
    let values = values.into_iter().map(|value| *value.borrow());
    let (sum, count) = values.fold((0.0, 0_usize), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / count as f64)
}

/// PSNR over the pixels at which `counts` `[H, W, 1]` is 1; over all without it.
pub fn psnr_counted(image: Tensor<3>, truth: Tensor<3>, counts: Option<Tensor<3>>) -> f64 {
    match counts {
        None => psnr(image, truth),
        Some(counts) => psnr_masked(image, truth, counts),
    }
}

/// PSNR in dB of a mean squared error; at most `PSNR_MAX`.
pub fn psnr_of_mse(mse: f64) -> f64 {
    -10.0 * mse.max(mse_of_psnr(PSNR_MAX)).log10()
}

/// Whether a PSNR says that images are equal, which no training of photos reaches: they hold nothing to be learned,
/// such as one colour.
pub fn is_of_equal_images(psnr: f64) -> bool {
    psnr >= PSNR_MAX - 0.005
}

/// A PSNR for people, two digits after the point.
pub fn shown_psnr(psnr: f64) -> String {
    if is_of_equal_images(psnr) { format!("{PSNR_MAX} dB or more") } else { format!("{psnr:.2} dB") }
}

/// [`shown_psnr`] for a table of dB.
pub fn psnr_cell(psnr: f64) -> String {
    if is_of_equal_images(psnr) { format!(">= {PSNR_MAX}") } else { format!("{psnr:.2}") }
}

/// The mean squared error of a PSNR in dB.
pub fn mse_of_psnr(psnr: f64) -> f64 {
    10.0_f64.powf(-0.1 * psnr)
}

/// Mean structural similarity, -1 to 1.
pub fn ssim(image: Tensor<3>, truth: Tensor<3>) -> f64 {
    let both = l1_ssim(image, truth);
    f64::from(both.narrow(0, 1, 1).into_scalar::<f32>())
}

/// The mean of structural similarity over the pixels at which `counts`, `[H, W, 1]`, is 1; from -1 to 1, and `None`
/// without such a pixel. Windows reach beyond these pixels.
pub fn ssim_masked(image: Tensor<3>, truth: Tensor<3>, counts: Tensor<3>) -> Option<f64> {
    let channels = image.dims()[2];
    let counts = Plane::channels(counts).next()?;
    let similarity = Similarity { luminance: true, border: Border::Zero };
    let planes = Plane::channels(image).zip(Plane::channels(truth));
    let means: Option<Vec<f64>> = planes.map(|(x, y)| similarity.mean(&x, &y, Some(&counts))).collect();
    // Equal images may have a rounding more than 1.
    Some((means?.iter().sum::<f64>() / channels as f64).clamp(-1.0, 1.0))
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, TensorData};
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn tensor(values: Vec<f32>, [height, width]: [usize; 2]) -> Tensor<3> {
        let channels = values.len() / (height * width);
        Tensor::from_data(TensorData::new(values, [height, width, channels]), &Device::flex())
    }

    /// A flat image has no structure, so that SSIM is luminance alone: in the middle of a large image, where windows
    /// see one value each,
    /// `(2 a b + C1) / (a^2 + b^2 + C1)`; and 1 where both have the same value.
    #[test]
    fn ssim_inside_a_mask_is_the_mean_of_its_pixels() {
        let (height, width) = (60, 80);
        let flat = |value: f32| tensor(vec![value; 3 * height * width], [height, width]);
        let mask = |inside: &dyn Fn(usize, usize) -> bool| {
            let values = (0..height * width).map(|i| f32::from(u8::from(inside(i / width, i % width)))).collect();
            tensor(values, [height, width])
        };
        let middle = mask(&|y, x| (20..40).contains(&y) && (30..50).contains(&x));
        let found = ssim_masked(flat(0.25), flat(0.75), middle.clone()).expect("pixels");
        let expected = (2.0 * 0.25 * 0.75 + 1e-4) / (0.25 * 0.25 + 0.75 * 0.75 + 1e-4);
        assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");

        // An error outside of the mask and its windows costs nothing; one pixel of the mask at the error's middle has
        // what the error costs.
        let spot = mask(&|y, x| (5..35).contains(&y) && (10..40).contains(&x));
        let image = flat(0.25) + spot.repeat_dim(2, 3) * 0.5;
        let far = mask(&|y, x| y > 45 && x > 50);
        let found = ssim_masked(image.clone(), flat(0.25), far).expect("pixels");
        assert!((found - 1.0).abs() < 1e-12, "{found}");
        let pixel = mask(&|y, x| y == 20 && x == 25);
        let found = ssim_masked(image, flat(0.25), pixel).expect("a pixel");
        assert!((found - expected).abs() < 1e-12, "{found}, not {expected}");
        assert_eq!(ssim_masked(flat(0.0), flat(1.0), mask(&|_, _| false)), None);
    }

    /// Noise and its negative, which have no structure in common, give the lowest values; masks are from a pixel to
    /// all.
    #[test]
    fn ssim_inside_a_mask_is_between_its_bounds_and_that_of_all_pixels_is_the_kernel_s() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut lowest: f64 = 1.0;
        for trial in 0..40 {
            let size @ [height, width] = [rng.random_range(1..40), rng.random_range(1..40)];
            let mut noise = |count: usize| -> Vec<f32> { (0..count).map(|_| rng.random_range(0.0..1.0)).collect() };
            let values = noise(3 * height * width);
            let other = match trial % 2 {
                0 => noise(3 * height * width),
                _ => values.iter().map(|x| 1.0 - x).collect(),
            };
            let (image, truth) = (tensor(values, size), tensor(other, size));
            let share = rng.random_range(0.01..1.0);
            let chosen = rng.random_range(0..height * width);
            let counts = (0..height * width).map(|i| f32::from(u8::from(i == chosen || rng.random_bool(share))));
            let inside = ssim_masked(image.clone(), truth.clone(), tensor(counts.collect(), size)).expect("a pixel");
            assert!((-1.0..=1.0).contains(&inside), "{inside}");
            lowest = lowest.min(inside);
            let all = ssim_masked(image.clone(), truth.clone(), tensor(vec![1.0; height * width], size));
            let kernel = ssim(image, truth);
            assert!((all.expect("pixels") - kernel).abs() < 1e-4, "{all:?} and {kernel}");
        }
        assert!(lowest < -0.5, "{lowest} is no hard case");
    }

    #[test]
    fn equal_images_are_no_success() {
        let flat = tensor(vec![0.5; 12], [2, 2]);
        let psnr = psnr(flat.clone(), flat);
        assert!(is_of_equal_images(psnr) && !is_of_equal_images(60.0), "{psnr}");
        assert_eq!((shown_psnr(psnr).as_str(), shown_psnr(31.416).as_str()), ("100 dB or more", "31.42 dB"));
    }
}
