//! `#[serde(with = "gs_models::bits")]`: floats as their bits, because a JSON reader may lose the last one, and a
//! resumed run must go on to the bit.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Writes the bits.
///
/// # Errors
/// Errors of the serializer.
pub fn serialize<T: Bits, S: Serializer>(value: &T, serializer: S) -> Result<S::Ok, S::Error> {
    value.to_bits().serialize(serializer)
}

/// Reads bits.
///
/// # Errors
/// When there is no integer of the right size.
pub fn deserialize<'de, T: Bits, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    T::Bits::deserialize(deserializer).map(T::from_bits)
}

/// Something made of floats.
pub trait Bits: Sized {
    /// The integers of the same size.
    type Bits: Serialize + DeserializeOwned;
    /// The bits.
    fn to_bits(&self) -> Self::Bits;
    /// The floats of `bits`.
    fn from_bits(bits: Self::Bits) -> Self;
}

impl Bits for f64 {
    type Bits = u64;
    fn to_bits(&self) -> u64 {
        f64::to_bits(*self)
    }
    fn from_bits(bits: u64) -> Self {
        f64::from_bits(bits)
    }
}

impl<const N: usize> Bits for [f64; N]
where
    [u64; N]: Serialize + DeserializeOwned,
{
    type Bits = [u64; N];
    fn to_bits(&self) -> [u64; N] {
        self.map(f64::to_bits)
    }
    fn from_bits(bits: [u64; N]) -> Self {
        bits.map(f64::from_bits)
    }
}
