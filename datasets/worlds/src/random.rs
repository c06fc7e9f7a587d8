//! Sequences of one seed, and draws that `rand` leaves to another crate.

use std::f64::consts::TAU;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A draw from the normal distribution (Box and Muller).
pub(super) fn gaussian(rng: &mut impl Rng) -> f64 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (TAU * rng.random::<f64>()).cos()
}

/// Sequences of one seed that do not depend on each other, so that a change of one option leaves the rest of a world
/// as it is.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Draws {
    Scene,
    Rig,
    Points,
    /// The shake of photo `.0`.
    Shake(u64),
    /// Faults of prior `.0`.
    Prior(u64),
}

impl Draws {
    pub fn rng(self, seed: u64) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(match self {
            Self::Scene => 0,
            Self::Rig => 1,
            Self::Points => 2,
            Self::Prior(index) => 16 + index,
            Self::Shake(index) => 1 << 40 | index,
        });
        rng
    }
}
