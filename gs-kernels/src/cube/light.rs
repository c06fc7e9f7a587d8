//! From an encoded image to its light and back, through the curve of sRGB; the twin of [`crate::cpu::light`].

use cubecl::prelude::*;

use crate::constants;

const GAMMA: f32 = constants::SRGB_GAMMA as f32;
const ROOT: f32 = (1.0 / constants::SRGB_GAMMA) as f32;
const OFFSET: f32 = constants::SRGB_OFFSET as f32;
const SCALE: f32 = (1.0 + constants::SRGB_OFFSET) as f32;
const SLOPE: f32 = constants::SRGB_SLOPE as f32;
const KNEE: f32 = constants::SRGB_KNEE as f32;
const LIGHT_KNEE: f32 = constants::SRGB_LIGHT_KNEE as f32;

/// The light of an encoded value.
#[cube]
pub(crate) fn to_linear(value: f32) -> f32 {
    let mut light = value / SLOPE;
    if value > KNEE {
        light = ((value + OFFSET) / SCALE).powf(GAMMA);
    }
    light
}

/// Slope of [`to_linear`] at `value`, whose light is `light`.
#[cube]
pub(crate) fn to_linear_slope(value: f32, light: f32) -> f32 {
    select(value > KNEE, GAMMA * light / (value + OFFSET), 1.0f32 / SLOPE)
}

/// The encoded value of light.
#[cube]
pub(crate) fn to_encoded(light: f32) -> f32 {
    let mut value = light * SLOPE;
    if light > LIGHT_KNEE {
        value = SCALE * light.powf(ROOT) - OFFSET;
    }
    value
}

/// Slope of [`to_encoded`] at `light`, whose encoded value is `value`.
#[cube]
pub(crate) fn to_encoded_slope(light: f32, value: f32) -> f32 {
    let mut slope = SLOPE.runtime();
    if light > LIGHT_KNEE {
        slope = (value + OFFSET) / (GAMMA * light);
    }
    slope
}
