//! PSNR after a fit of colours: how well a rendering shows the scene where exposure and white balance of the photo are
//! not known.

use burn::tensor::Tensor;
use glam::DVec3;
use gs_base::least_squares::{combined, least_squares};

use super::psnr_of_mse;
use crate::fit::parameters::to_host;

/// PSNR of `image` after the affine change of its colours that brings it nearest to `truth`, both `[H, W, 3]` from 0 to
/// 1, over the pixels at which `counts` `[H, W, 1]` is 1 (`None`: all), dB; `None` without such a pixel.
pub fn psnr_after_color_fit(image: Tensor<3>, truth: Tensor<3>, counts: Option<Tensor<3>>) -> Option<f64> {
    let [image, truth] = [image, truth].map(to_host);
    let counts = counts.map(to_host);
    let pixels: Vec<usize> =
        (0..image.len() / 3).filter(|pixel| counts.as_ref().is_none_or(|counts| counts[*pixel] > 0.5)).collect();
    if pixels.is_empty() {
        return None;
    }
    let channel = |c: usize| pixels.iter().map(|pixel| f64::from(image[3 * pixel + c])).collect::<Vec<_>>();
    let columns = [vec![1.0; pixels.len()], channel(0), channel(1), channel(2)];
    let color = |pixel: &usize| DVec3::from_array([0, 1, 2].map(|c| f64::from(truth[3 * pixel + c])));
    let colors: Vec<DVec3> = pixels.iter().map(color).collect();
    let change = least_squares(&columns, &colors);
    let error = |(i, color): (usize, &DVec3)| {
        (combined(&columns, &change, i).clamp(DVec3::ZERO, DVec3::ONE) - *color).length_squared()
    };
    let squares: f64 = colors.iter().enumerate().map(error).sum();
    Some(psnr_of_mse(squares / (3 * pixels.len()) as f64))
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, TensorData};

    use super::*;
    use crate::run::metrics::psnr;

    fn image(value: impl Fn(usize) -> f32) -> Tensor<3> {
        let values: Vec<f32> = (0..8 * 6 * 3).map(value).collect();
        Tensor::from_data(TensorData::new(values, [6, 8, 3]), &Device::default())
    }

    /// A change of colours costs nothing, and pixels that do not count tell nothing.
    #[test]
    fn a_change_of_colours_costs_nothing() {
        let scene = |i: usize| 0.2 + 0.5 * ((i * 37 % 101) as f32 / 101.0);
        let gains = [1.3, 0.8, 1.1];
        let (seen, taken) = (image(scene), image(|i| gains[i % 3] * scene(i) + 0.05));
        assert!(psnr(seen.clone(), taken.clone()) < 20.0);
        // f32 holds the values to 6e-8; 100 dB is the PSNR of equal images.
        assert!(psnr_after_color_fit(seen.clone(), taken.clone(), None).expect("pixels") > 99.0);

        let damaged = image(|i| if i < 24 { 0.9 } else { gains[i % 3] * scene(i) + 0.05 });
        let below: Vec<f32> = (0..48).map(|pixel| if pixel < 8 { 0.0 } else { 1.0 }).collect();
        let counts = Tensor::from_data(TensorData::new(below, [6, 8, 1]), &Device::default());
        assert!(psnr_after_color_fit(seen.clone(), damaged.clone(), None).expect("pixels") < 40.0);
        assert!(psnr_after_color_fit(seen.clone(), damaged, Some(counts)).expect("pixels") > 99.0);
        assert_eq!(psnr_after_color_fit(seen.clone(), taken, Some(Tensor::zeros([6, 8, 1], &Device::default()))), None);
    }
}
