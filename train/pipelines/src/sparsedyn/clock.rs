//! The unit of time of the dynamics.
//!
//! Learning rates and encodings are made for times from 0 to 1, of which three quarters are seen. Other recordings
//! (seconds, frame numbers) are learned in such a unit, and asked and answered in their own.

use serde::{Deserialize, Serialize};

/// Share of the unit that is seen of a recording in another unit: as in the sets whose times lie in [0, 1].
const SEEN: f64 = 0.75;

/// Smallest share of the unit that a recording in [0, 1] fills for its times to be taken as they are: below it,
/// velocities would be large for the learning rates.
const LEAST: f64 = 0.25;

/// The map from the data set's times to those of the dynamics: `(t - origin) / unit`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Clock {
    /// The time that is 0.
    #[serde(with = "gs_models::bits")]
    pub origin: f64,
    /// How much is 1, above 0.
    #[serde(with = "gs_models::bits")]
    pub unit: f64,
}

impl Default for Clock {
    fn default() -> Self {
        Self { origin: 0.0, unit: 1.0 }
    }
}

impl Clock {
    /// The clock of a recording whose frames have these times, ascending.
    pub fn of(times: &[f64]) -> Self {
        let (Some(first), Some(last)) = (times.first().copied(), times.last().copied()) else { return Self::default() };
        let inside = first >= 0.0 && last <= 1.0;
        match last - first {
            range if range <= 0.0 || (inside && range >= LEAST) => Self::default(),
            range => Self { origin: first, unit: range / SEEN },
        }
    }

    /// Whether times are taken as they are.
    pub fn is_plain(&self) -> bool {
        *self == Self::default()
    }

    /// A time of the data set as one of the dynamics.
    pub fn inner(&self, time: f64) -> f64 {
        (time - self.origin) / self.unit
    }

    /// A time of the dynamics as one of the data set.
    pub fn outer(&self, time: f64) -> f64 {
        self.origin + time * self.unit
    }

    /// Whether it is usable, after it was read from a file.
    pub fn is_usable(&self) -> bool {
        self.origin.is_finite() && self.unit.is_finite() && self.unit > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_from_0_to_1_stay_and_others_are_scaled_there() {
        for times in [[0.0, 0.75], [0.0, 1.0], [0.2, 0.5], [3.0, 3.0]] {
            assert!(Clock::of(&times).is_plain(), "{times:?}");
        }
        for times in [[0.0, 44.0], [100.0, 287.5], [-1.0, 0.5], [0.0, 0.01]] {
            let clock = Clock::of(&times);
            assert!((clock.inner(times[0]), clock.inner(times[1])) == (0.0, 0.75), "{times:?}");
            assert!((clock.outer(clock.inner(times[1])) - times[1]).abs() < 1e-9);
        }
        assert!(Clock::of(&[]).is_plain());
    }
}
