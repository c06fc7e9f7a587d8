//! One fused Adam step (Kingma and Ba 2015) in place. It moves 28 bytes per parameter, the minimum.

use cubecl::prelude::*;

use crate::config::{AdamConfig, FirstColumns};
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for};

/// The step's constants as launch scalars.
#[derive(CubeType, CubeLaunch, Clone, Copy)]
#[expand(derive(Clone, Copy))]
struct AdamScalars {
    /// Learning rate over the first moment's bias correction.
    rate: f32,
    /// The rate of the first columns of a row.
    first_rate: f32,
    /// Values in a row.
    row: u32,
    /// Columns of a row that have `first_rate`.
    first: u32,
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
#[cube(launch_unchecked)]
fn adam_kernel(params: &mut [f32], grads: &[f32], m: &mut [f32], v: &mut [f32], count: u32, scalars: AdamScalars) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index < count as usize {
        let g = grads[index];
        let first = scalars.beta1 * m[index] + scalars.rest1 * g;
        let second = scalars.beta2 * v[index] + scalars.rest2 * g * g;
        m[index] = first;
        v[index] = second;
        let of_first = (index as u32) % scalars.row < scalars.first;
        let rate = select(of_first, scalars.first_rate, scalars.rate);
        params[index] -= rate * first / (second.sqrt() * scalars.spread + scalars.eps);
    }
}

/// Updates `params`, `m` and `v` in place from `grads`; the twin of [`crate::cpu::adam::step`].
///
/// # Panics
/// When the buffers disagree in length, `step` is 0, or the parameters are not whole rows.
pub fn step(client: &Client, params: &Buffer, grads: &Buffer, m: &Buffer, v: &Buffer, config: &AdamConfig) {
    assert!(config.step > 0, "Adam's steps count from 1");
    let len = params.len();
    assert!(grads.len() == len && m.len() == len && v.len() == len, "Adam's buffers differ in length");
    if len == 0 {
        return;
    }
    let exponent = i32::try_from(config.step).unwrap_or(i32::MAX);
    let corrected = |lr: f64| (lr / (1.0 - config.beta1.powi(exponent))) as f32;
    let none = FirstColumns { row: 1, count: 0, lr: 0.0 };
    let first = config.first_columns.filter(|first| first.count > 0).unwrap_or(none);
    assert!(first.row > 0 && len.is_multiple_of(first.row), "{len} parameters are not rows of {}", first.row);
    let spread = 1.0 / (1.0 - config.beta2.powi(exponent)).sqrt();
    let scalars = AdamScalarsLaunch::new(
        corrected(config.lr),
        corrected(first.lr),
        first.row as u32,
        first.count as u32,
        spread as f32,
        config.beta1 as f32,
        (1.0 - config.beta1) as f32,
        config.beta2 as f32,
        (1.0 - config.beta2) as f32,
        config.eps as f32,
    );
    // SAFETY: all four buffers hold `len` numbers.
    unsafe {
        adam_kernel::launch_unchecked(
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
}
