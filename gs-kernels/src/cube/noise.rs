//! The position noise of 3DGS-MCMC (Kheradmand et al. 2024, Eq. 8), in place; the twin of [`crate::cpu::noise`]. Rows
//! draw the same words as there; their normal numbers differ by the rounding of `ln`, `sin` and `cos`.

use cubecl::prelude::*;

use crate::config::NoiseConfig;
use crate::cube::buffer::{Buffer, UNITS, cube_dim, grid_for};
use crate::cube::math::{Quat, Vec3, finite3, mat_t_vec, mat_vec, norm2, read3, rotation, scaled, times};
use crate::cube::opacity::{is_number, sigmoid};
use crate::random::{PARITY, ROTATIONS, ROUNDS, UNIFORM_BITS};

/// Two words.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
struct Words {
    a: u32,
    b: u32,
}

/// [`crate::random::threefry`].
#[cube]
fn threefry(key: Words, row: u32, counter: u32) -> Words {
    let last = PARITY ^ key.a ^ key.b;
    let mut a = row + key.a;
    let mut b = counter + key.b;
    #[unroll]
    for round in 0..ROUNDS {
        let turn = comptime!(ROTATIONS[round % 8]);
        let back = comptime!(32 - ROTATIONS[round % 8]);
        a += b;
        b = ((b << turn) | (b >> back)) ^ a;
        if comptime!(round % 4 == 3) {
            let injection = comptime!(round / 4 + 1);
            a += scheduled(key, last, comptime!(injection % 3));
            b += scheduled(key, last, comptime!((injection + 1) % 3)) + comptime!(injection as u32);
        }
    }
    Words { a, b }
}

/// Word `index` of the key's schedule.
#[cube]
fn scheduled(key: Words, last: u32, #[comptime] index: usize) -> u32 {
    let mut word = last;
    if comptime!(index == 0) {
        word = key.a;
    }
    if comptime!(index == 1) {
        word = key.b;
    }
    word
}

/// A word as a number in [0, 1).
#[cube]
fn uniform(word: u32) -> f32 {
    f32::cast_from(word >> comptime!(32 - UNIFORM_BITS)) * comptime!(1.0 / (1u32 << UNIFORM_BITS) as f32)
}

/// The step's constants as launch scalars.
#[derive(CubeType, CubeLaunch, Clone, Copy)]
#[expand(derive(Clone, Copy))]
struct NoiseScalars {
    key_a: u32,
    key_b: u32,
    first: u32,
    second: u32,
    strength: f32,
    steepness: f32,
    opacity: f32,
    gate_min: f32,
}

/// [`crate::cpu::noise::gate`].
#[cube]
fn gate_of(logit: f32, steepness: f32, opacity: f32) -> f32 {
    sigmoid(steepness * (opacity - sigmoid(logit)))
}

/// One unit per Gaussian.
#[cube(launch_unchecked)]
fn noise_kernel(
    means: &mut [f32],
    quats: &[f32],
    log_scales: &[f32],
    logits: &[f32],
    count: u32,
    scalars: NoiseScalars,
) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index >= count as usize {
        terminate!();
    }
    let logit = logits[index];
    let gate = gate_of(logit, scalars.steepness, scalars.opacity);
    if is_number(logit) && gate >= scalars.gate_min {
        let key = Words { a: scalars.key_a, b: scalars.key_b };
        let row = index as u32;
        let one = threefry(key, row, scalars.first);
        let two = threefry(key, row, scalars.second);
        let floor = comptime!(1.0 / (1u32 << UNIFORM_BITS) as f32);
        let turn = comptime!(std::f32::consts::TAU);
        let half = comptime!(std::f32::consts::PI);
        let radius = (-2.0f32 * (uniform(one.a) + floor).ln()).sqrt();
        let angle = turn * uniform(one.b) - half;
        let third = (-2.0f32 * (uniform(two.a) + floor).ln()).sqrt() * (turn * uniform(two.b) - half).cos();
        let normals = Vec3 { x: radius * angle.cos(), y: radius * angle.sin(), z: third };

        let base = index * 4;
        let q = Quat { w: quats[base], x: quats[base + 1], y: quats[base + 2], z: quats[base + 3] };
        let inverse = 1.0f32 / norm2(q).sqrt();
        let unit = Quat { w: q.w * inverse, x: q.x * inverse, y: q.y * inverse, z: q.z * inverse };
        let turned = rotation(unit);
        let scales = read3(log_scales, index);
        let variances =
            Vec3 { x: (2.0f32 * scales.x).exp(), y: (2.0f32 * scales.y).exp(), z: (2.0f32 * scales.z).exp() };
        let offset = scaled(scalars.strength * gate, mat_vec(turned, times(variances, mat_t_vec(turned, normals))));
        if finite3(offset) {
            let base = index * 3;
            means[base] += offset.x;
            means[base + 1] += offset.y;
            means[base + 2] += offset.z;
        }
    }
}

/// Moves `means` `[N, 3]` in place; the twin of [`crate::cpu::noise::perturb`].
///
/// # Panics
/// When the buffers disagree in length.
pub fn perturb(
    client: &Client,
    means: &Buffer,
    quats: &Buffer,
    log_scales: &Buffer,
    logits: &Buffer,
    config: &NoiseConfig,
) {
    let count = logits.len();
    let fits = means.len() == 3 * count && quats.len() == 4 * count && log_scales.len() == 3 * count;
    assert!(fits, "means, quats and log_scales must be [N, 3], [N, 4] and [N, 3] for {count} logits");
    if count == 0 {
        return;
    }
    let (key, counters) = (config.key(), config.counters());
    let scalars = NoiseScalarsLaunch::new(
        key[0],
        key[1],
        counters[0],
        counters[1],
        config.strength as f32,
        config.steepness as f32,
        config.opacity as f32,
        config.gate_min as f32,
    );
    // SAFETY: every index is below the length of its buffer by the assertion above.
    unsafe {
        noise_kernel::launch_unchecked(
            client,
            grid_for(count),
            cube_dim(),
            means.arg(),
            quats.arg(),
            log_scales.arg(),
            logits.arg(),
            count as u32,
            scalars,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A gate of zero would be one over infinity, which WGSL leaves open. The kernel's function runs on the host here.
    #[test]
    fn no_exponential_of_the_gate_overflows() {
        for (logit, gate) in
            [(6.0, (-99.25f64).exp()), (2.2, (-89.525f64).exp()), (-40.0, 1.0 / (1.0 + (-0.5f64).exp()))]
        {
            let found = f64::from(gate_of(logit, 100.0, 0.005));
            assert!((found / gate - 1.0).abs() < 0.02, "{found:e} instead of {gate:e}");
        }
    }
}
