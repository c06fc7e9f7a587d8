//! Relighting: whether two colours are one surface under different light.
//!
//! Light multiplies a linear colour, and the encoding is close to a power, so encoded values differ by a factor too,
//! nearly the same in all channels.

/// Darkest factor (of encoded values) of a shadow. An umbra lit by the sky alone is at about 0.4; darker pixels are
/// black objects.
const DARKEST: f32 = 0.35;

/// Brightest factor of a pixel whose background was in shadow for most of the time. No more than a weak shadow
/// inverted, since bright objects are as common as dark ones.
const BRIGHTEST: f32 = 1.25;

/// Tolerance between the channels' factors, and its growth towards factor 0: the sky that lights a shadow is bluer than
/// the lamp that does not.
const TINT: [f32; 2] = [0.03, 0.25];

/// Tolerance between a factor and the mean of two opposite neighbours. The edge of a soft shadow is straight on this
/// scale, texture is not.
const BEND: f32 = 0.035;

/// A background darker than this many standard deviations of noise has no measurable factor.
const DARK: f32 = 12.0;

/// Limits of light that is still accepted as light on the same surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LightLimits {
    /// Darkest factor.
    pub darkest: f32,
    /// Brightest factor without further evidence.
    pub brightest: f32,
    /// Brightest factor of a pixel that does not change between frames: full light over the darkest shadow.
    pub lit: f32,
    tint: [f32; 2],
    /// Tolerance of smoothness.
    pub bend: f32,
}

impl LightLimits {
    /// The limits at [`MaskOptions::shadow`](crate::MaskOptions::shadow); a scale of 1 is exact.
    pub fn scaled(shadow: f64) -> Self {
        let scale = shadow as f32;
        let darkest = DARKEST.powf(scale);
        Self {
            darkest,
            brightest: BRIGHTEST.powf(scale),
            lit: 1.0 / darkest,
            tint: TINT.map(|tint| tint * scale),
            bend: BEND * scale,
        }
    }

    /// Whether a colour may be `mean` under darker or brighter light, judged by this pixel alone.
    pub fn is_light(&self, color: &[u8; 3], mean: &[f32; 3], deviation: f32, noise: f32) -> bool {
        (self.darkest..=self.lit).contains(&self.factor(color, mean, deviation, noise))
    }

    /// Mean factor over the channels; NaN if the channels disagree. `noise` is the image's: where shadows come and go,
    /// a pixel's own deviation is not the sensor's.
    pub fn factor(&self, color: &[u8; 3], mean: &[f32; 3], deviation: f32, noise: f32) -> f32 {
        if mean.iter().any(|value| *value < DARK * noise) {
            return f32::NAN;
        }
        let [r, g, b] = [0, 1, 2].map(|c| f32::from(color[c]) / mean[c]);
        let average = (r + g + b) / 3.0;
        let darkest = mean.iter().copied().fold(f32::INFINITY, f32::min);
        let tolerance = self.tint[0] + self.tint[1] * (1.0 - average).abs() + 3.0 * deviation / darkest;
        let spread = r.max(g).max(b) - r.min(g).min(b);
        if spread <= tolerance { average } else { f32::NAN }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_of_one_is_exact_and_of_zero_accepts_no_shadow() {
        let limits = LightLimits::scaled(1.0);
        assert_eq!((limits.darkest, limits.brightest, limits.lit), (0.35, 1.25, 1.0 / 0.35));
        assert_eq!((limits.tint, limits.bend), (TINT, BEND));
        let limits = LightLimits::scaled(0.0);
        assert_eq!((limits.darkest, limits.brightest, limits.lit), (1.0, 1.0, 1.0));
    }
}
