//! Relighting: whether two colours are one surface under different light.
//!
//! Light multiplies a linear colour, and the encoding is close to a power, so encoded values differ by a factor too,
//! nearly the same in all channels.

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

/// A background darker than this many standard deviations of noise has no measurable factor.
const DARK: f32 = 12.0;

/// Whether a colour may be `mean` under darker or brighter light, judged by this pixel alone.
pub(crate) fn is_light(color: &[u8; 3], mean: &[f32; 3], deviation: f32, noise: f32) -> bool {
    (DARKEST..=LIT).contains(&factor(color, mean, deviation, noise))
}

/// Mean factor over the channels; NaN if the channels disagree. `noise` is the image's: where shadows come and go, a
/// pixel's own deviation is not the sensor's.
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
