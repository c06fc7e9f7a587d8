//! SPZ, the compressed format of Niantic: versions 2 to 4 are read, 3 is written.
//!
//! One gzip stream: a header of 16 bytes, then arrays over all Gaussians: positions, alphas, colours, scales,
//! rotations, harmonics. A stream whose gzip was undone, as browsers and servers do, is read too. Version 4 has a zstd
//! stream for each array instead. Everything is quantised; see `docs/formats.md` for the bytes and what they lose.

mod far;
mod read;
mod rotation;
#[cfg(test)]
mod tests;
mod write;
mod zstd;

pub use far::{Far, far};
pub use read::{decode, read};
pub use write::{encode, fractional_bits, oversized, write};

/// "NGSP", little-endian.
const MAGIC: u32 = 0x5053_474e;
/// Before the offset of a scene far from its world's origin, in the comment of the gzip stream: the format has no place
/// for text.
const OFFSET: &str = "; offset ";
/// Bytes before the arrays.
const HEADER: usize = 16;
/// Bit of the header's flags: trained with antialiasing.
const ANTIALIASED: u8 = 1;
/// Bits behind the point of a position where the scene fits into 2048 units.
pub const FRACTIONAL_BITS: u32 = 12;
/// Steps of the logarithm of a scale, and its least value.
const SCALE_STEPS: f32 = 16.0;
const SCALE_LEAST: f32 = -10.0;
/// Share of a colour's byte that a unit of `f_dc` takes.
const COLOUR: f32 = 0.15;
