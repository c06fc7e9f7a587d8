//! Draws that `rand` leaves to another crate.

use std::f64::consts::TAU;

use rand::Rng;

/// A draw from the normal distribution (Box and Muller).
pub(super) fn gaussian(rng: &mut impl Rng) -> f64 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (TAU * rng.random::<f64>()).cos()
}
