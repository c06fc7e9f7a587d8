//! Shadows: darker than the background (or brighter, where that was in shadow) by a smooth factor that is nearly the
//! same in all channels.
//!
//! A shadow moves with its object but lies on static surfaces. Left in the masks it pulls the object's centre to the
//! floor and adds a flat patch to its hull. It multiplies the light of a surface, and the encoding is close to a power,
//! so encoded values fall by a factor too: smooth over the image, whatever the texture below.

use gs_datasets::View;

use crate::background::{Plate, color, counts};

/// Darkest factor (of encoded values) that is still called shadow. An umbra lit by the sky alone is at about 0.4;
/// lower than this are black objects.
const DARKEST: f32 = 0.35;

/// Brightest one: where the background itself was in shadow for most of the time, what differs is the light. No more
/// than that of a weak shadow, since bright objects are as common as dark ones, unless it rests as what is lit does: then up to
/// [`LIT`].
const BRIGHTEST: f32 = 1.25;

/// What is lit over its darkest shadow.
const LIT: f32 = 1.0 / DARKEST;

/// How much the channels' factors may differ, and how much more at factor 0: the sky that lights a shadow is bluer than
/// the lamp that does not.
const TINT: [f32; 2] = [0.03, 0.25];

/// Most that a factor may differ from the mean of two opposite neighbours. The edge of a soft shadow is straight on
/// this scale, texture is not.
const BEND: f32 = 0.035;

/// Background darker than this many standard deviations of noise has no factor to speak of.
const DARK: f32 = 12.0;

/// One frame beside another of the same camera: where does it show the same in another light?
pub(crate) struct Light<'a> {
    plate: &'a Plate,
    view: &'a View,
    other: &'a View,
}

impl<'a> Light<'a> {
    /// Of `view` over `other`, both of the plate's size.
    pub fn new(plate: &'a Plate, view: &'a View, other: &'a View) -> Self {
        Self { plate, view, other }
    }

    /// Whether a pixel is that of the other frame in a shadow, or in a little more light.
    pub fn is_shadow(&self, pixel: usize) -> bool {
        self.is_light(pixel, BRIGHTEST)
    }

    /// Whether it is that of the other frame in another light, brighter too.
    pub fn is_other(&self, pixel: usize) -> bool {
        self.is_light(pixel, LIT)
    }

    fn is_light(&self, pixel: usize, brightest: f32) -> bool {
        let factor = self.factor(pixel);
        (DARKEST..=brightest).contains(&factor) && self.is_smooth(pixel, factor)
    }

    fn factor(&self, pixel: usize) -> f32 {
        if !counts(self.view, pixel) || !counts(self.other, pixel) {
            return f32::NAN;
        }
        let mean = color(self.other, pixel).map(f32::from);
        factor(&color(self.view, pixel), &mean, self.plate.deviation[pixel], self.plate.noise)
    }

    fn is_smooth(&self, pixel: usize, factor: f32) -> bool {
        let (width, height) = self.plate.size;
        let level = color(self.other, pixel).map(f32::from).iter().sum::<f32>() / 3.0;
        // Of two means of three channels, and of a second difference of their ratio (1 + 2/4 times the variance).
        let noise = 2.0 * self.plate.deviation[pixel] / level;
        let (x, y) = (pixel % width, pixel / width);
        let (across, down) = (x > 0 && x + 1 < width, y > 0 && y + 1 < height);
        // NaN neighbours fail the comparison: an edge of the shadow's object is near. At the image's edge fewer are asked.
        [(1, across), (width, down), (width - 1, across && down), (width + 1, across && down)]
            .into_iter()
            .filter(|(_, inside)| *inside)
            .all(|(step, _)| {
                let mean = 0.5 * (self.factor(pixel - step) + self.factor(pixel + step));
                (factor - mean).abs() <= (BEND + noise) * factor.max(1.0)
            })
    }
}

/// Whether a colour may be `mean` in another light, darker or brighter, by what one pixel says.
pub(crate) fn is_light(color: &[u8; 3], mean: &[f32; 3], deviation: f32, noise: f32) -> bool {
    (DARKEST..=LIT).contains(&factor(color, mean, deviation, noise))
}

/// The mean factor of the channels; NaN where they do not agree on it. `noise` is the image's: where shadows come and go, a
/// pixel's own deviation is none of the sensor.
fn factor(color: &[u8], mean: &[f32; 3], deviation: f32, noise: f32) -> f32 {
    if mean.iter().any(|value| *value < DARK * noise) {
        return f32::NAN;
    }
    let [r, g, b] = [0, 1, 2].map(|c| f32::from(color[c]) / mean[c]);
    let average = (r + g + b) / 3.0;
    let darkest = mean.iter().copied().fold(f32::INFINITY, f32::min);
    let tolerance = TINT[0] + TINT[1] * (1.0 - average).abs() + 3.0 * deviation / darkest;
    let spread = r.max(g).max(b) - r.min(g).min(b);
    if spread <= tolerance { average } else { f32::NAN }
}
