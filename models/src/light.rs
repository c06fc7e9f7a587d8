//! Light: encoded colour, as files store it, to linear, in which light adds up, and back; the sRGB curve of
//! IEC 61966-2-1. The same constants as `gs_datasets::light`.
//!
//! `linear = x / 12.92` up to [`KNEE_ENCODED`], `((x + 0.055) / 1.055)^2.4` above. Neither way clamps: outside 0..1 the
//! two branches go on, so a colour that overshoots still has a gradient.

use burn::tensor::Tensor;

/// Where the curve changes from a line to a power, encoded.
pub const KNEE_ENCODED: f64 = 0.04045;
/// The same place in linear light, as the standard rounds it.
pub const KNEE_LINEAR: f64 = 0.003_130_8;
/// Slope of the line.
pub const SLOPE: f64 = 12.92;
/// Offset of the power branch.
pub const OFFSET: f64 = 0.055;
/// Exponent of the power branch.
pub const EXPONENT: f64 = 2.4;

/// Encoded colour to linear light, any shape; differentiable.
pub fn to_linear<const D: usize>(encoded: Tensor<D>) -> Tensor<D> {
    let dark = encoded.clone().lower_equal_scalar(KNEE_ENCODED);
    // The floor keeps the unused branch, and so its gradient, finite.
    let bright = ((encoded.clone().clamp_min(KNEE_ENCODED) + OFFSET) / (1.0 + OFFSET)).powf_scalar(EXPONENT);
    bright.mask_where(dark, encoded / SLOPE)
}

/// Linear light to encoded colour, any shape; differentiable.
pub fn to_encoded<const D: usize>(linear: Tensor<D>) -> Tensor<D> {
    let dark = linear.clone().lower_equal_scalar(KNEE_LINEAR);
    let bright = linear.clone().clamp_min(KNEE_LINEAR).powf_scalar(1.0 / EXPONENT) * (1.0 + OFFSET) - OFFSET;
    bright.mask_where(dark, linear * SLOPE)
}

/// In which space colours are averaged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mixing {
    /// As light adds up on a sensor.
    #[default]
    Linear,
    /// The stored numbers themselves, as the paper's Eq. 12 reads; for images blurred that way.
    Encoded,
}

impl Mixing {
    /// Colours as stored to where they are averaged.
    pub fn decode<const D: usize>(self, encoded: Tensor<D>) -> Tensor<D> {
        if self == Self::Linear { to_linear(encoded) } else { encoded }
    }

    /// And back.
    pub fn encode<const D: usize>(self, mixed: Tensor<D>) -> Tensor<D> {
        if self == Self::Linear { to_encoded(mixed) } else { mixed }
    }
}
