//! Shadows: darker than the background (or brighter, where that was in shadow) by a smooth factor that is nearly the
//! same in all channels.
//!
//! A shadow moves with its object but lies on static surfaces. Left in the masks it pulls the object's centre to the
//! floor and adds a flat patch to its hull. It multiplies the light of a surface, and the encoding is close to a power,
//! so encoded values fall by a factor too: smooth over the image, whatever the texture below.

use super::background::Plate;

/// Darkest factor (of encoded values) that is still called shadow. An umbra lit by the sky alone is at about 0.4;
/// lower than this are black objects.
const DARKEST: f32 = 0.35;

/// Brightest one: where the background itself was in shadow for most of the time, what differs is the light. No more
/// than that of a weak shadow, since bright objects are as common as dark ones.
const BRIGHTEST: f32 = 1.25;

/// How much the channels' factors may differ, and how much more at factor 0: the sky that lights a shadow is bluer than
/// the lamp that does not.
const TINT: [f32; 2] = [0.03, 0.25];

/// Most that a factor may differ from the mean of two opposite neighbours. The edge of a soft shadow is straight on
/// this scale, texture is not.
const BEND: f32 = 0.035;

/// Background darker than this many standard deviations of noise has no factor to speak of.
const DARK: f32 = 12.0;

/// For one frame: the factor of every pixel, and whether its channels agree on it.
pub(crate) struct Shadows<'a> {
    plate: &'a Plate,
    /// Mean factor over the channels; NaN where it is none of a shadow.
    factor: Vec<f32>,
}

impl<'a> Shadows<'a> {
    /// `image` is `[height, width, 3]` of the plate's size.
    pub fn new(plate: &'a Plate, image: &[u8]) -> Self {
        let factor = image
            .chunks_exact(3)
            .zip(plate.mean.iter().zip(&plate.deviation))
            .map(|(color, (mean, deviation))| factor(color, mean, *deviation))
            .collect();
        Self { plate, factor }
    }

    /// Whether a pixel (not at the image's edge) looks like a shadow on the background.
    pub fn contains(&self, pixel: usize) -> bool {
        let factor = self.factor[pixel];
        if !(DARKEST..=BRIGHTEST).contains(&factor) {
            return false;
        }
        let width = self.plate.size.0;
        let level = self.plate.mean[pixel].iter().sum::<f32>() / 3.0;
        // Of the mean of three channels, and of a second difference of it (1 + 2/4 times the variance).
        let noise = 2.0 * (0.5_f32).sqrt() * self.plate.deviation[pixel] / level;
        // NaN neighbours fail the comparison: an edge of the shadow's object is near.
        [1, width - 1, width, width + 1].iter().all(|step| {
            let mean = 0.5 * (self.factor[pixel - step] + self.factor[pixel + step]);
            (factor - mean).abs() <= BEND + noise
        })
    }
}

fn factor(color: &[u8], mean: &[f32; 3], deviation: f32) -> f32 {
    if mean.iter().any(|value| *value < DARK * deviation) {
        return f32::NAN;
    }
    let [r, g, b] = [0, 1, 2].map(|c| f32::from(color[c]) / mean[c]);
    let average = (r + g + b) / 3.0;
    let darkest = mean.iter().copied().fold(f32::INFINITY, f32::min);
    let tolerance = TINT[0] + TINT[1] * (1.0 - average).abs() + 3.0 * deviation / darkest;
    let spread = r.max(g).max(b) - r.min(g).min(b);
    if spread <= tolerance { average } else { f32::NAN }
}
