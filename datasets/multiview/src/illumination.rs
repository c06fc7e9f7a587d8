//! By which factor the light on a surface differs between two colours of it.

/// Darkest factor (of encoded values) that is still called shadow. An umbra lit by the sky alone is at about 0.4;
/// lower than this are black objects.
pub(crate) const DARKEST: f32 = 0.35;

/// Brightest one: where the background itself was in shadow for most of the time, what differs is the light. No more
/// than that of a weak shadow, since bright objects are as common as dark ones, unless it rests as what is lit does: then up to
/// [`LIT`].
pub(crate) const BRIGHTEST: f32 = 1.25;

/// What is lit over its darkest shadow.
pub(crate) const LIT: f32 = 1.0 / DARKEST;

/// How much the channels' factors may differ, and how much more at factor 0: the sky that lights a shadow is bluer than
/// the lamp that does not.
const TINT: [f32; 2] = [0.03, 0.25];

/// Background darker than this many standard deviations of noise has no factor to speak of.
const DARK: f32 = 12.0;

/// Whether a colour may be `mean` in another light, darker or brighter, by what one pixel says.
pub(crate) fn is_light(color: &[u8; 3], mean: &[f32; 3], deviation: f32, noise: f32) -> bool {
    (DARKEST..=LIT).contains(&factor(color, mean, deviation, noise))
}

/// The mean factor of the channels; NaN where they do not agree on it. `noise` is the image's: where shadows come and go, a
/// pixel's own deviation is none of the sensor.
pub(crate) fn factor(color: &[u8], mean: &[f32; 3], deviation: f32, noise: f32) -> f32 {
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
