//! Side-by-side pictures: photo, rendering, error.

use super::future::strip::{Picture, joined};
use gs_train::fit::parameters::to_host;
use gs_train::run::evaluate::Comparison;
use gs_train::run::pixels::{image_bytes, to_bytes};

/// Mean absolute error that is drawn in the brightest colour.
pub const ERROR_FULL_SCALE: f32 = 0.25;

/// Colour in the error panel of pixels that are not compared.
const IGNORED: [u8; 3] = [70, 78, 90];

/// Colours of the error from none to full scale: black, violet, red, orange, pale yellow. Lightness rises evenly, so
/// that the panel also reads in grey.
const HEAT: [[f32; 3]; 5] = [[0., 0., 4.], [87., 16., 110.], [188., 55., 84.], [249., 142., 9.], [252., 255., 164.]];

/// A picture of three or four panels of equal size, 8 bits RGB.
#[derive(Debug, Clone)]
pub struct SideBySide {
    /// The view's name.
    pub name: String,
    /// PSNR of the rendering, dB.
    pub psnr: f64,
    /// Width of the whole picture, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    /// Number of panels.
    pub panels: usize,
    /// `[height, width, 3]`.
    pub pixels: Vec<u8>,
    /// Names of the panels after the error.
    pub more: Vec<&'static str>,
}

impl SideBySide {
    /// Blurry photo (if known and the compared one is sharp), photo, rendering, error and what there is beside these,
    /// from left to right.
    pub fn new(comparison: &Comparison) -> Self {
        let [height, width, _] = comparison.truth.dims();
        let (truth, image) = (to_host(comparison.truth.clone()), to_host(comparison.image.clone()));
        let mut heat: Vec<[u8; 3]> =
            truth.chunks_exact(3).zip(image.chunks_exact(3)).map(|(a, b)| heat_of(a, b)).collect();
        if let Some(mask) = &comparison.mask {
            let ignored = to_host(mask.clone()).into_iter().map(|value| value == 0.0);
            heat.iter_mut().zip(ignored).filter(|(_, ignored)| *ignored).for_each(|(color, _)| *color = IGNORED);
        }
        let blurry = comparison.blurry.as_ref().map(|blurry| image_bytes(blurry.clone()));
        let more = comparison.more.iter().map(|(_, picture)| image_bytes(picture.clone()));
        let panels = blurry.into_iter().chain([to_bytes(&truth), to_bytes(&image), heat.into_flattened()]).chain(more);
        let panels: Vec<Picture> = panels.map(|pixels| Picture { width, height, pixels }).collect();
        let (name, psnr, count) = (comparison.name.clone(), comparison.psnr, panels.len());
        let Picture { width, height, pixels } = joined(&[panels]);
        let more = comparison.more.iter().map(|(name, _)| *name).collect();
        Self { name, psnr, width, height, panels: count, pixels, more }
    }
}

fn heat_of(truth: &[f32], image: &[f32]) -> [u8; 3] {
    let error = truth.iter().zip(image).map(|(a, b)| (a - b).abs()).sum::<f32>() / 3.0;
    let place = (error / ERROR_FULL_SCALE).clamp(0.0, 1.0) * (HEAT.len() - 1) as f32;
    let low = (place as usize).min(HEAT.len() - 2);
    let share = place - low as f32;
    [0, 1, 2].map(|c| (HEAT[low][c] + share * (HEAT[low + 1][c] - HEAT[low][c]) + 0.5) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heat_goes_from_dark_to_light() {
        assert_eq!(heat_of(&[0.5; 3], &[0.5; 3]), [0, 0, 4]);
        assert_eq!(heat_of(&[0.0; 3], &[1.0; 3]), [252, 255, 164]);
    }
}
