//! Other colours for a snippet of the training: brightness, contrast and tint of a whole snippet are drawn anew for
//! each step (`learning.recolour`, beyond the paper).
//!
//! `c' = (g_k c)^gamma`, with the gain `g_k` of a channel and `gamma` drawn once for all images and first Gaussians of
//! the snippet. Few logs have few lights and paints; a network that saw no others knows them by heart.

use gs_datasets::RgbImage8;
use gs_models::flux4d::channels::{CHANNELS, COLOR};
use gs_models::flux4d::lift::logit;
use rand::Rng;

use super::host_view::HostView;
use super::prepare::HostSnippet;
use gs_train::fit::random::{Purpose, stream};

/// A channel's own part of the logarithm of the gain, of the part that all channels share: light has less colour than
/// brightness.
const TINT: f64 = 0.3;

/// A map of colours.
struct Curve {
    gains: [f64; 3],
    gamma: f64,
}

impl Curve {
    /// Logarithms of gain and gamma are uniform within `strength`.
    fn draw(strength: f64, random: &mut impl Rng) -> Self {
        let mut within = |reach: f64| random.random_range(-reach..=reach);
        let (gain, gamma) = (within(strength), within(strength).exp());
        Self { gains: [(); 3].map(|()| (gain + within(TINT * strength)).exp()), gamma }
    }

    fn of(&self, channel: usize, value: f64) -> f64 {
        (self.gains[channel] * value).min(1.0).powf(self.gamma)
    }

    fn image(&self, image: &mut RgbImage8) {
        let byte = |channel, value: usize| (255.0 * self.of(channel, value as f64 / 255.0)).round() as u8;
        let tables = [0, 1, 2].map(|channel| (0..256).map(|value| byte(channel, value)).collect::<Vec<u8>>());
        for pixel in image.data.chunks_exact_mut(3) {
            pixel.iter_mut().zip(&tables).for_each(|(value, table)| *value = table[usize::from(*value)]);
        }
    }
}

/// A snippet in the colours of draw `draw` of the training.
pub fn recoloured(host: &HostSnippet, strength: f64, seed: u64, draw: usize) -> HostSnippet {
    let mut random = stream(seed, Purpose::Colors, draw as u64);
    let curve = Curve::draw(strength, &mut random);
    let mut host = host.clone();
    for row in host.rows.raw.chunks_exact_mut(CHANNELS) {
        for (channel, value) in row[COLOR].iter_mut().enumerate() {
            let color = 1.0 / (1.0 + f64::from(-*value).exp());
            *value = logit(curve.of(channel, color) as f32);
        }
    }
    let views = host.inputs.iter_mut().chain(&mut host.targets).chain(&mut host.future);
    views.for_each(|view: &mut HostView| curve.image(&mut view.image));
    host
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand::rngs::StdRng;

    /// A lifted colour and the pixel that it came from stay the same colour, to half a step of 8 bits and the margin of
    /// a logit.
    #[test]
    fn rows_and_images_change_alike() {
        for seed in 0..20 {
            let curve = Curve::draw(0.5, &mut StdRng::seed_from_u64(seed));
            let mut image = RgbImage8 { width: 2, height: 1, data: vec![0, 1, 60, 128, 250, 255] };
            let before = image.data.clone();
            curve.image(&mut image);
            for (place, (old, new)) in before.iter().zip(&image.data).enumerate() {
                let row = curve.of(place % 3, f64::from(*old) / 255.0);
                assert!((row - f64::from(*new) / 255.0).abs() <= 0.5 / 255.0 + 1e-9);
            }
        }
        let still = Curve::draw(0.0, &mut StdRng::seed_from_u64(1));
        assert!((0..=10).all(|i| (still.of(0, f64::from(i) / 10.0) - f64::from(i) / 10.0).abs() < 1e-12));
    }
}
