//! Every random draw of a run, from one seed.
//!
//! A draw is identified by its purpose and its step, and each pair has its own ChaCha8 stream. No state is carried from
//! draw to draw, so a resumed run needs no generator state, and more draws for one purpose do not change those for
//! another.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// The purpose of a stream of random numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Points for a data set without any, and the choice among too many.
    Init = 1,
    /// The order of the training views in an epoch.
    Views = 2,
    /// The choice of Gaussians that are duplicated, split or relocated.
    Density = 3,
    /// The position noise of budgeted relocation.
    Noise = 4,
    /// The synthetic workload of `bench`.
    Bench = 5,
    /// The views in which contributions are measured.
    Prune = 6,
    /// The direction of a step of integration.
    Direction = 7,
    /// The members of an ensemble of futures.
    Ensemble = 8,
    /// The Gaussians whose paths are drawn.
    Paths = 9,
    /// The order of the snippets in an epoch.
    Snippets = 10,
    /// The images that a snippet is compared with in a step.
    Supervision = 11,
    /// The images that a polished snippet is compared with in a step.
    Polish = 12,
    /// The colours of a snippet in a step.
    Colors = 13,
    /// The first paths of the cameras during their exposures.
    Shake = 14,
}

/// The generator for `purpose` at `index` (a step or an epoch, below 2^56).
pub fn stream(seed: u64, purpose: Purpose, index: u64) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream((purpose as u64) << 56 | index);
    rng
}

/// Two independent standard normal numbers (Box and Muller 1958).
pub fn normal_pair(rng: &mut impl Rng) -> [f64; 2] {
    // 1 - u lies in (0, 1], where the logarithm is finite.
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    let angle = std::f64::consts::TAU * rng.random::<f64>();
    [radius * angle.cos(), radius * angle.sin()]
}

/// Three independent standard normal numbers.
pub fn normal_triple(rng: &mut impl Rng) -> glam::DVec3 {
    let ([x, y], [z, _]) = (normal_pair(rng), normal_pair(rng));
    glam::DVec3::new(x, y, z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_repeat_and_differ() {
        let draw = |purpose, index| stream(7, purpose, index).random::<u64>();
        assert_eq!(draw(Purpose::Noise, 3), draw(Purpose::Noise, 3));
        assert_ne!(draw(Purpose::Noise, 3), draw(Purpose::Noise, 4));
        assert_ne!(draw(Purpose::Noise, 3), draw(Purpose::Density, 3));
    }

    #[test]
    fn normals_have_mean_zero_and_variance_one() {
        let mut rng = stream(1, Purpose::Noise, 0);
        let draws: Vec<f64> = (0..20_000).flat_map(|_| normal_pair(&mut rng)).collect();
        let mean = draws.iter().sum::<f64>() / draws.len() as f64;
        let variance = draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / draws.len() as f64;
        // Four standard errors: 4 / sqrt(40000) and 4 sqrt(2 / 40000).
        assert!(mean.abs() < 0.02 && (variance - 1.0).abs() < 0.03, "{mean} {variance}");
    }
}
