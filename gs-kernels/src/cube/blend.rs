//! One Gaussian at one pixel: alpha and transmittance. The forward walk and both walks of the backward pass call it.

use cubecl::prelude::*;

use crate::constants;

/// [`constants::ALPHA_MIN`] in the device's float.
pub(crate) const ALPHA_MIN: f32 = constants::ALPHA_MIN as f32;
/// [`constants::ALPHA_MAX`] in the device's float.
pub(crate) const ALPHA_MAX: f32 = constants::ALPHA_MAX as f32;
/// [`constants::TRANSMITTANCE_MIN`] in the device's float.
pub(crate) const TRANSMITTANCE_MIN: f32 = constants::TRANSMITTANCE_MIN as f32;

/// A Gaussian seen from one pixel.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(crate) struct Sight {
    /// `dx + l dy`.
    pub u: f32,
    /// `opacity exp(-sigma)`, not capped.
    pub raw: f32,
}

/// `u`, and `raw` with `sigma = 1/2 (d1 (dx + l dy)^2 + d2 dy^2)`.
#[cube]
pub(crate) fn sight(dx: f32, dy: f32, d1: f32, l: f32, d2: f32, opacity: f32) -> Sight {
    let u = dx + l * dy;
    let sigma = 0.5f32 * (d1 * u * u + d2 * dy * dy);
    Sight { u, raw: opacity * (-sigma).exp() }
}

/// Alpha of a visible Gaussian.
#[cube]
pub(crate) fn capped(raw: f32) -> f32 {
    select(raw < ALPHA_MAX, raw, ALPHA_MAX.runtime())
}
