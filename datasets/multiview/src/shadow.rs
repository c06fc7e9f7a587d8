//! Shadows: pixels darker than the background (or brighter, where the background was in shadow) by a spatially smooth
//! factor.
//!
//! A shadow moves with its object but lies on static surfaces. In the masks it would pull the object's centre to the
//! floor and add a flat patch to the hull. Its factor is smooth over the image whatever the texture below, which
//! tells it from an object.

use gs_datasets::View;

use crate::background::BackgroundModel;
use crate::pixels::{color, counts};

/// A pair of frames of one camera, compared for changes of light.
pub(crate) struct Light<'a> {
    model: &'a BackgroundModel,
    view: &'a View,
    other: &'a View,
}

impl<'a> Light<'a> {
    /// Compares `view` with `other`, both of the model's size.
    pub fn new(model: &'a BackgroundModel, view: &'a View, other: &'a View) -> Self {
        Self { model, view, other }
    }

    /// Whether a pixel shows the other frame's surface in shadow, or in slightly brighter light.
    pub fn is_shadow(&self, pixel: usize) -> bool {
        self.is_light(pixel, self.model.light.brightest)
    }

    /// Whether a pixel shows the other frame's surface in any other light, much brighter included.
    pub fn is_other(&self, pixel: usize) -> bool {
        self.is_light(pixel, self.model.light.lit)
    }

    fn is_light(&self, pixel: usize, brightest: f32) -> bool {
        let factor = self.factor(pixel);
        (self.model.light.darkest..=brightest).contains(&factor) && self.is_smooth(pixel, factor)
    }

    fn factor(&self, pixel: usize) -> f32 {
        if !counts(self.view, pixel) || !counts(self.other, pixel) {
            return f32::NAN;
        }
        let mean = color(self.other, pixel).map(f32::from);
        self.model.light.factor(&color(self.view, pixel), &mean, self.model.deviation[pixel], self.model.noise)
    }

    fn is_smooth(&self, pixel: usize, factor: f32) -> bool {
        let (width, height) = self.model.size;
        let level = color(self.other, pixel).map(f32::from).iter().sum::<f32>() / 3.0;
        // Noise of the mean of three channels, of two frames, and of a second difference of their ratio (1 + 2/4
        // times the variance).
        let noise = 2.0 * self.model.deviation[pixel] / level;
        let (x, y) = (pixel % width, pixel / width);
        let (across, down) = (x > 0 && x + 1 < width, y > 0 && y + 1 < height);
        // A NaN neighbour fails the comparison: an edge of the object is near. At the image's edge fewer neighbours
        // exist.
        [(1, across), (width, down), (width - 1, across && down), (width + 1, across && down)]
            .into_iter()
            .filter(|(_, inside)| *inside)
            .all(|(step, _)| {
                let mean = 0.5 * (self.factor(pixel - step) + self.factor(pixel + step));
                (factor - mean).abs() <= (self.model.light.bend + noise) * factor.max(1.0)
            })
    }
}
