//! Binary glTF with `KHR_gaussian_splatting`, and the motion in an extension of our own.
//!
//! Every value is a float as it is in the scene, but for opacities and scales, which the extension wants after the
//! sigmoid and the exponential. `docs/formats.md` has the layout. Files of others are read with all primitives of
//! Gaussians, the transforms of their nodes, and the whole numbers that the extension allows.

mod arrays;
mod motion;
mod nodes;
mod placed;
mod primitive;
mod read;
#[cfg(test)]
mod tests;
mod write;

pub use read::{Contents, decode, read};
pub use write::{encode, write};

/// The extension of the Khronos group.
const SPLATS: &str = "KHR_gaussian_splatting";
/// Our extension of the same primitive.
const MOTION: &str = "GSBURN_gaussian_motion";
/// Of the motion: whole vectors for each row, or bodies and what rows have beside them. A reader refuses what it does
/// not know.
const MOTION_VERSIONS: [u64; 2] = [1, 2];

/// "glTF", "JSON" and "BIN\0", little-endian.
const MAGIC: u32 = 0x4654_6c67;
const JSON_CHUNK: u32 = 0x4e4f_534a;
const BIN_CHUNK: u32 = 0x004e_4942;

/// Component types of accessors.
const BYTE: u64 = 5120;
const UNSIGNED_BYTE: u64 = 5121;
const SHORT: u64 = 5122;
const UNSIGNED_SHORT: u64 = 5123;
const UNSIGNED_INT: u64 = 5125;
const FLOAT: u64 = 5126;

/// An opacity nearer to 0 or 1 than this has no finite logit in `f32` arithmetic.
const OPACITY_LEAST: f64 = 1e-7;

/// The name of harmonic `index` (0 to 15) as an attribute.
fn harmonic_name(index: usize) -> String {
    let degree = index.isqrt();
    format!("{SPLATS}:SH_DEGREE_{degree}_COEF_{}", index - degree * degree)
}
