//! Encoded colour, as files store it, to linear light, which adds up, and back: the sRGB curve of IEC 61966-2-1, whose
//! constants are in [`gs_burn::constants`].
//!
//! `linear = x / 12.92` up to 0.04045, `((x + 0.055) / 1.055)^2.4` above. Neither way clamps: outside 0..1 the two
//! branches go on, so a colour that overshoots still has a gradient.

use burn::tensor::Tensor;
use gs_burn::constants::{SRGB_GAMMA, SRGB_KNEE, SRGB_LIGHT_KNEE, SRGB_OFFSET, SRGB_SLOPE};

/// Encoded colour to linear light, any shape; differentiable.
pub fn to_linear<const D: usize>(encoded: Tensor<D>) -> Tensor<D> {
    let dark = encoded.clone().lower_equal_scalar(SRGB_KNEE);
    // The floor keeps the unused branch, and so its gradient, finite.
    let bright = ((encoded.clone().clamp_min(SRGB_KNEE) + SRGB_OFFSET) / (1.0 + SRGB_OFFSET)).powf_scalar(SRGB_GAMMA);
    bright.mask_where(dark, encoded / SRGB_SLOPE)
}

/// Linear light to encoded colour, any shape; differentiable.
pub fn to_encoded<const D: usize>(linear: Tensor<D>) -> Tensor<D> {
    let dark = linear.clone().lower_equal_scalar(SRGB_LIGHT_KNEE);
    let bright =
        linear.clone().clamp_min(SRGB_LIGHT_KNEE).powf_scalar(1.0 / SRGB_GAMMA) * (1.0 + SRGB_OFFSET) - SRGB_OFFSET;
    bright.mask_where(dark, linear * SRGB_SLOPE)
}

/// The space in which colours are averaged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Mixing {
    /// As light adds up on a sensor.
    #[default]
    Linear,
    /// The stored numbers themselves, as the paper's Eq. 12 reads; for images blurred that way.
    Encoded,
}

impl Mixing {
    /// Stored colours in the space of averaging.
    pub fn decode<const D: usize>(self, encoded: Tensor<D>) -> Tensor<D> {
        if self == Self::Linear { to_linear(encoded) } else { encoded }
    }

    /// Averaged colours as they are stored.
    pub fn encode<const D: usize>(self, mixed: Tensor<D>) -> Tensor<D> {
        if self == Self::Linear { to_encoded(mixed) } else { mixed }
    }
}
