//! One fused Adam step (Kingma and Ba 2015) in place. It moves 28 bytes per parameter, the minimum.

use cubecl::prelude::*;

use crate::config::AdamConfig;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for};

/// The step's constants as launch scalars.
#[derive(CubeType, CubeLaunch, Clone, Copy)]
#[expand(derive(Clone, Copy))]
struct AdamScalars {
    /// Learning rate over the first moment's bias correction.
    rate: f32,
    /// Inverse root of the second moment's bias correction.
    spread: f32,
    /// Decay of the first moment.
    beta1: f32,
    /// `1 - beta1`.
    rest1: f32,
    /// Decay of the second moment.
    beta2: f32,
    /// `1 - beta2`.
    rest2: f32,
    /// Added to the root of the second moment.
    eps: f32,
}

/// One unit per parameter.
#[cube(launch)]
fn adam_kernel(params: &mut [f32], grads: &[f32], m: &mut [f32], v: &mut [f32], count: u32, scalars: AdamScalars) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index < count as usize {
        let g = grads[index];
        let first = scalars.beta1 * m[index] + scalars.rest1 * g;
        let second = scalars.beta2 * v[index] + scalars.rest2 * g * g;
        m[index] = first;
        v[index] = second;
        params[index] -= scalars.rate * first / (second.sqrt() * scalars.spread + scalars.eps);
    }
}

/// Updates `params`, `m` and `v` in place from `grads`; the twin of [`crate::cpu::adam::step`].
///
/// # Panics
/// When the buffers disagree in length or `step` is 0.
pub fn step(client: &Client, params: &Buffer, grads: &Buffer, m: &Buffer, v: &Buffer, config: &AdamConfig) {
    assert!(config.step > 0, "Adam's steps count from 1");
    let len = params.len();
    assert!(grads.len() == len && m.len() == len && v.len() == len, "Adam's buffers differ in length");
    if len == 0 {
        return;
    }
    let exponent = i32::try_from(config.step).unwrap_or(i32::MAX);
    let rate = config.lr / (1.0 - config.beta1.powi(exponent));
    let spread = 1.0 / (1.0 - config.beta2.powi(exponent)).sqrt();
    let scalars = AdamScalarsLaunch::new(
        rate as f32,
        spread as f32,
        config.beta1 as f32,
        (1.0 - config.beta1) as f32,
        config.beta2 as f32,
        (1.0 - config.beta2) as f32,
        config.eps as f32,
    );
    adam_kernel::launch(
        client,
        grid_for(len),
        cube_dim(),
        params.arg(),
        grads.arg(),
        m.arg(),
        v.arg(),
        len as u32,
        scalars,
    );
}
