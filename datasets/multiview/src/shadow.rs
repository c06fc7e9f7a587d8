//! Shadows: darker than the background (or brighter, where that was in shadow) by a smooth factor that is nearly the
//! same in all channels.
//!
//! A shadow moves with its object but lies on static surfaces. Left in the masks it pulls the object's centre to the
//! floor and adds a flat patch to its hull. It multiplies the light of a surface, and the encoding is close to a power,
//! so encoded values fall by a factor too: smooth over the image, whatever the texture below.

use gs_datasets::View;

use crate::background::Plate;
use crate::illumination::{BRIGHTEST, DARKEST, LIT, factor};
use crate::pixels::{color, counts};

/// Most that a factor may differ from the mean of two opposite neighbours. The edge of a soft shadow is straight on
/// this scale, texture is not.
const BEND: f32 = 0.035;

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
