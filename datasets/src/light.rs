//! Between colour values as files encode them and linear light: the sRGB transfer curve (IEC 61966-2-1).
//!
//! A sensor adds up light, not encoded values, so motion blur, averages of frames and downscaling of what a camera sees
//! belong in linear light. This pair is the one used throughout; encoded and linear values both run from 0 to 1.

use gs_kernels::constants::{SRGB_GAMMA, SRGB_KNEE, SRGB_LIGHT_KNEE, SRGB_OFFSET, SRGB_SLOPE};

const LINEAR_KNEE: f32 = SRGB_LIGHT_KNEE as f32;
const ENCODED_KNEE: f32 = SRGB_KNEE as f32;
const SLOPE: f32 = SRGB_SLOPE as f32;
const OFFSET: f32 = SRGB_OFFSET as f32;
const GAMMA: f32 = SRGB_GAMMA as f32;

/// Linear light of an encoded value. Defined, continuous and increasing for all finite numbers; the straight part goes
/// on below 0, the curved part above 1.
pub fn to_linear(encoded: f32) -> f32 {
    if encoded <= ENCODED_KNEE { encoded / SLOPE } else { ((encoded + OFFSET) / (1.0 + OFFSET)).powf(GAMMA) }
}

/// The encoded value of linear light; the inverse of [`to_linear`].
pub fn to_encoded(linear: f32) -> f32 {
    if linear <= LINEAR_KNEE { linear * SLOPE } else { (1.0 + OFFSET) * linear.powf(1.0 / GAMMA) - OFFSET }
}

/// The byte that stores linear light, rounded to the nearest; values outside 0 to 1 are clipped as a sensor clips them.
pub fn to_byte(linear: f32) -> u8 {
    (255.0 * to_encoded(linear.clamp(0.0, 1.0))).round() as u8
}

/// Linear light of every byte.
pub fn linear_of_bytes() -> [f32; 256] {
    std::array::from_fn(|byte| to_linear(byte as f32 / 255.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values_of_the_standard() {
        // 0.5 encoded is 21.4 % of the light; 18 % grey is encoded as 46.1 %.
        assert!((to_linear(0.5) - 0.214_041).abs() < 1e-5);
        assert!((to_encoded(0.18) - 0.461_356).abs() < 1e-5);
        for end in [0.0, 1.0] {
            assert!((to_linear(end) - end).abs() < 1e-6 && (to_encoded(end) - end).abs() < 1e-6);
        }
    }

    #[test]
    fn the_pair_inverts_and_bytes_survive() {
        let table = linear_of_bytes();
        for byte in 0..=255_u8 {
            assert_eq!(to_byte(table[usize::from(byte)]), byte);
        }
        // f32 and the standard's rounded constants leave 1e-6; the two straight parts meet the curves within 1e-7 /
        // 12.92.
        for i in -50..=1200 {
            let encoded = i as f32 / 1000.0;
            assert!((to_encoded(to_linear(encoded)) - encoded).abs() < 2e-6, "{encoded}");
        }
    }

    #[test]
    fn increasing_across_the_knee() {
        let around = |knee: f32| [knee * 0.999, knee, knee * 1.001];
        assert!(around(LINEAR_KNEE).map(to_encoded).is_sorted());
        assert!(around(ENCODED_KNEE).map(to_linear).is_sorted());
    }
}
