//! Vectors as TOML has them.

use glam::DVec3;
use serde::{Deserialize, Deserializer};

/// Reads three numbers.
pub(super) fn vector<'de, D: Deserializer<'de>>(numbers: D) -> Result<DVec3, D::Error> {
    <[f64; 3]>::deserialize(numbers).map(DVec3::from_array)
}
