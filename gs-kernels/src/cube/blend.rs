//! One Gaussian at one pixel: alpha and transmittance. The forward walk and that of the backward pass call it.

use cubecl::prelude::*;

use crate::constants;

/// [`constants::ALPHA_MIN`] in the device's float.
pub(crate) const ALPHA_MIN: f32 = constants::ALPHA_MIN as f32;
/// [`constants::ALPHA_MAX`] in the device's float.
pub(crate) const ALPHA_MAX: f32 = constants::ALPHA_MAX as f32;
/// [`constants::TRANSMITTANCE_MIN`] in the device's float.
pub(crate) const TRANSMITTANCE_MIN: f32 = constants::TRANSMITTANCE_MIN as f32;

/// `u`, and twice sigma: with them a pixel beyond the cut-off ellipse needs no exponential.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(crate) struct Place {
    /// `dx + l dy`.
    pub u: f32,
    /// `d1 (dx + l dy)^2 + d2 dy^2`.
    pub twice_sigma: f32,
}

#[cube]
pub(crate) fn place(dx: f32, dy: f32, d1: f32, l: f32, d2: f32) -> Place {
    let u = dx + l * dy;
    Place { u, twice_sigma: d1 * u * u + d2 * dy * dy }
}

/// `opacity exp(-sigma)`, not capped.
#[cube]
pub(crate) fn raw_alpha(twice_sigma: f32, opacity: f32) -> f32 {
    opacity * (-(0.5f32 * twice_sigma)).exp()
}

/// Alpha of a visible Gaussian.
#[cube]
pub(crate) fn capped(raw: f32) -> f32 {
    select(raw < ALPHA_MAX, raw, ALPHA_MAX.runtime())
}
