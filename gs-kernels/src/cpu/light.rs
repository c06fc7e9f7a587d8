//! From an encoded image to its light and back: the curve of sRGB (IEC 61966-2-1), continued below 0 and above 1, so
//! that a value slightly out of range passes its gradient like any other.

use crate::constants::{SRGB_GAMMA, SRGB_KNEE, SRGB_LIGHT_KNEE, SRGB_OFFSET, SRGB_SLOPE};
use crate::cpu::Real;

/// The light of an encoded value.
#[inline(always)]
pub fn to_linear<F: Real>(value: F) -> F {
    if value <= F::of(SRGB_KNEE) {
        value / F::of(SRGB_SLOPE)
    } else {
        ((value + F::of(SRGB_OFFSET)) / F::of(1.0 + SRGB_OFFSET)).powf(F::of(SRGB_GAMMA))
    }
}

/// Slope of [`to_linear`] at `value`, whose light is `light`.
#[inline(always)]
pub fn to_linear_slope<F: Real>(value: F, light: F) -> F {
    if value <= F::of(SRGB_KNEE) {
        F::of(1.0 / SRGB_SLOPE)
    } else {
        F::of(SRGB_GAMMA) * light / (value + F::of(SRGB_OFFSET))
    }
}

/// The encoded value of light.
#[inline(always)]
pub fn to_encoded<F: Real>(light: F) -> F {
    if light <= F::of(SRGB_LIGHT_KNEE) {
        light * F::of(SRGB_SLOPE)
    } else {
        F::of(1.0 + SRGB_OFFSET) * light.powf(F::of(1.0 / SRGB_GAMMA)) - F::of(SRGB_OFFSET)
    }
}

/// Slope of [`to_encoded`] at `light`, whose encoded value is `value`.
#[inline(always)]
pub fn to_encoded_slope<F: Real>(light: F, value: F) -> F {
    if light <= F::of(SRGB_LIGHT_KNEE) {
        F::of(SRGB_SLOPE)
    } else {
        (value + F::of(SRGB_OFFSET)) / (F::of(SRGB_GAMMA) * light)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        // Middle grey of the standard: 0.5 encoded is 0.21404 of the light.
        assert!((to_linear(0.5_f64) - 0.214_041_140_482_232_6).abs() < 1e-15);
        assert!((to_linear(1.0_f64) - 1.0).abs() < 1e-15);
        assert!((to_encoded(1.0_f64) - 1.0).abs() < 1e-15);
        assert_eq!(to_encoded(0.0_f64), 0.0);
    }

    #[test]
    fn there_and_back() {
        for k in -20..130 {
            let value = 0.01 * f64::from(k);
            // The standard's two knees are rounded to five digits: next to them the branches differ by 3e-8.
            assert!((to_encoded(to_linear(value)) - value).abs() < 1e-7, "{value}");
            let single = value as f32;
            // Rounding of the power, relative, through a slope of at most 13.
            assert!((to_encoded(to_linear(single)) - single).abs() < 1e-6, "{single}");
        }
    }

    #[test]
    fn slopes_are_the_differences() {
        for k in -5..110 {
            let (value, h) = (0.01 * f64::from(k) + 0.003, 1e-6);
            let (up, down) = (to_linear(value + h), to_linear(value - h));
            let slope = to_linear_slope(value, to_linear(value));
            assert!(((up - down) / (2.0 * h) - slope).abs() < 1e-8, "linear at {value}");
            let light = to_linear(value);
            let h = 1e-7;
            let (up, down) = (to_encoded(light + h), to_encoded(light - h));
            let slope = to_encoded_slope(light, to_encoded(light));
            assert!(((up - down) / (2.0 * h) - slope).abs() < 1e-5 * slope, "encoded at {light}");
        }
    }
}
