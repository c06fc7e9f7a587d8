//! Raw channels to Gaussians (A.2): softplus and clamp for scales, sigmoid for opacity and colour, unit quaternions.
//!
//! A [`Gaussians`] holds logarithms of scales, logits of opacities and coefficients of spherical harmonics. The
//! opacity's sigmoid is its own; the activated scale and colour are written in its terms. Colours do not depend on the
//! direction of view.

use burn::tensor::{Tensor, TensorData, assert_shape};
use gs_burn::{Gaussians, profile};

use super::channels::{CHANNELS, COLOR, OPACITY, POSITION, QUATERNION, SCALE, SCALE_MAX, SCALE_MIN};

/// The zeroth real spherical harmonic, `1 / (2 sqrt(pi))`.
pub const SH_C0: f64 = 0.282_094_791_773_878_14;
/// Added to the squared norm of a quaternion: zero has a derivative, and no norm above 1e-3 changes by more than a
/// millionth.
const QUAT_FLOOR: f64 = 1e-12;

/// Largest scales, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScaleLimits {
    /// Limit of all rows but the sky's; the paper's is 1 m.
    pub near: f64,
    /// Limit of the sky's rows.
    pub sky: f64,
    /// The last rows that are sky.
    pub sky_rows: usize,
}

impl Default for ScaleLimits {
    fn default() -> Self {
        Self { near: SCALE_MAX, sky: SCALE_MAX, sky_rows: 0 }
    }
}

/// [`activate_within`] the paper's 1 m for all rows.
pub fn activate(raw: Tensor<2>) -> Gaussians {
    activate_within(raw, &ScaleLimits::default())
}

/// The Gaussians of `raw` `[N, 14]`; differentiable. A scale beyond its limit, or below 1 mm, receives no gradient.
///
/// # Panics
/// When `raw` has another number of columns, or there are fewer rows than sky rows.
pub fn activate_within(raw: Tensor<2>, limits: &ScaleLimits) -> Gaussians {
    let _stage = profile::stage("activation");
    let rows = raw.dims()[0];
    assert_shape!(raw, [rows, CHANNELS]);
    let part = |channels: std::ops::Range<usize>| raw.clone().narrow(1, channels.start, channels.len());
    let color = (part(COLOR) * 0.5).tanh() * (0.5 / SH_C0);
    Gaussians::from_tensors(
        part(POSITION),
        unit(part(QUATERNION)),
        scales(part(SCALE), limits).log(),
        part(OPACITY).squeeze_dim(1),
        color.reshape([rows, 1, 3]),
    )
}

/// `ln(1 + e^x)`, exact for large and small `x`, with the slope 1/2 at 0.
pub fn softplus<const D: usize>(x: Tensor<D>) -> Tensor<D> {
    let size = x.clone().abs();
    (x + size.clone()) * 0.5 + size.neg().exp().log1p()
}

/// Scales `[N, 3]`, metres, of the numbers before softplus and clamp.
fn scales(raw: Tensor<2>, limits: &ScaleLimits) -> Tensor<2> {
    let rows = raw.dims()[0];
    let scales = softplus(raw).clamp_min(SCALE_MIN);
    if limits.sky_rows == 0 || limits.sky == limits.near {
        return scales.clamp_max(limits.near);
    }
    assert!(limits.sky_rows <= rows, "{} of {rows} rows cannot be sky", limits.sky_rows);
    let near = rows - limits.sky_rows;
    let column: Vec<f64> = (0..rows).map(|row| if row < near { limits.near } else { limits.sky }).collect();
    let column: Tensor<2> = Tensor::from_data(TensorData::new(column, [rows, 1]), (&scales.device(), scales.dtype()));
    scales.min_pair(column.expand([rows, 3]))
}

fn unit(quats: Tensor<2>) -> Tensor<2> {
    let norm = (quats.clone().square().sum_dim(1) + QUAT_FLOOR).sqrt();
    quats / norm
}
