//! The position noise of 3DGS-MCMC (Kheradmand et al. 2024, Eq. 8), in place.

use rayon::prelude::*;

use crate::config::NoiseConfig;
use crate::cpu::Real;
use crate::cpu::math::rotation;
use crate::random::{normal_pair, threefry};

/// Rows per task; a task is about 20 microseconds where most gates are closed.
const BLOCK: usize = 4096;

/// Three independent standard normal numbers of a row at a step.
pub fn normals(row: u32, config: &NoiseConfig) -> [f64; 3] {
    let counters = config.counters();
    let [x, y] = normal_pair(threefry(config.key(), [row, counters[0]]));
    let [z, _] = normal_pair(threefry(config.key(), [row, counters[1]]));
    [x, y, z]
}

/// `1 / (1 + exp(-steepness (opacity - sigmoid(logit))))`: near 1 for a Gaussian that is hardly seen.
pub fn gate(logit: f64, config: &NoiseConfig) -> f64 {
    sigmoid(config.steepness * (config.opacity - sigmoid(logit)))
}

/// Slack of [`closed_above`], in logits: it changes a gate by a millionth of itself, 10^9 roundings.
const SLACK: f64 = 1e-6;

/// A logit above which every gate is certainly below `config.gate_min`. It spares most rows both exponentials.
fn closed_above(config: &NoiseConfig) -> f64 {
    let opacity = config.opacity - logit(config.gate_min) / config.steepness;
    // Outside 0..1 the gate is open or closed for all, and the rows tell.
    if opacity > 0.0 && opacity < 1.0 { logit(opacity) + SLACK } else { f64::INFINITY }
}

fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + (-x).exp())
}

/// The inverse of [`sigmoid`].
fn logit(share: f64) -> f64 {
    (share / (1.0 - share)).ln()
}

/// Moves every mean by `Sigma n strength gate`, with `Sigma` the Gaussian's covariance and `n` the [`normals`] of its
/// row. A gate under `config.gate_min` moves nothing, and neither does a Gaussian whose move is not finite.
///
/// # Panics
/// When the slices disagree in length.
pub fn perturb<F: Real>(means: &mut [F], quats: &[F], log_scales: &[F], logits: &[F], config: &NoiseConfig) {
    let count = logits.len();
    let fits = means.len() == 3 * count && quats.len() == 4 * count && log_scales.len() == 3 * count;
    assert!(fits, "means, quats and log_scales must be [N, 3], [N, 4] and [N, 3] for {count} logits");
    let closed_above = closed_above(config);
    means.par_chunks_mut(3 * BLOCK).enumerate().for_each(|(block, means)| {
        for (i, mean) in means.chunks_exact_mut(3).enumerate() {
            let row = block * BLOCK + i;
            let logit = logits[row].to_f64();
            if logit > closed_above {
                continue;
            }
            let gate = gate(logit, config);
            if gate < config.gate_min || gate.is_nan() {
                continue;
            }
            let quat = std::array::from_fn(|c| quats[4 * row + c].to_f64());
            let variances = std::array::from_fn(|c| (2.0 * log_scales[3 * row + c].to_f64()).exp());
            let offset = covariance_times(quat, variances, normals(row as u32, config));
            let offset = offset.map(|x| F::of(x * config.strength * gate));
            if offset.iter().all(|x| x.is_finite()) {
                for (mean, x) in mean.iter_mut().zip(offset) {
                    *mean += x;
                }
            }
        }
    });
}

/// `R diag(variances) R^T v` with R the rotation of the unnormalised quaternion w x y z.
fn covariance_times(quat: [f64; 4], variances: [f64; 3], v: [f64; 3]) -> [f64; 3] {
    let norm = quat.iter().map(|x| x * x).sum::<f64>().sqrt();
    let rotation = rotation(quat.map(|value| value / norm));
    let own: [f64; 3] = std::array::from_fn(|k| variances[k] * (0..3).map(|a| rotation[a][k] * v[a]).sum::<f64>());
    std::array::from_fn(|a| (0..3).map(|k| rotation[a][k] * own[k]).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_has_the_shape_of_the_gaussian() {
        let turned = [0.5f64.sqrt(), 0.0, 0.0, 0.5f64.sqrt()]; // 90 degrees about z
        let moved = covariance_times(turned, [4.0, 1.0, 0.25], [1.0; 3]);
        for (found, expected) in moved.into_iter().zip([1.0, 4.0, 0.25]) {
            assert!((found - expected).abs() < 1e-12, "{moved:?}");
        }
    }

    #[test]
    fn only_the_nearly_dead_are_gated() {
        let config = NoiseConfig::new(1.0, 0, 1);
        let open = |opacity: f64| gate(logit(opacity), &config) >= config.gate_min;
        assert_eq!([0.005, 0.9, 0.05, 0.2].map(open), [true, false, true, false]);
        assert!((gate(logit(0.005), &config) - 0.5).abs() < 1e-9);
    }

    #[test]
    fn gates_are_closed_above_the_bound_and_open_near_it() {
        for (steepness, gate_min) in [(100.0, 1e-3), (20.0, 1e-2), (100.0, 0.5), (5.0, 1e-6)] {
            let config = NoiseConfig { steepness, gate_min, ..NoiseConfig::new(1.0, 0, 1) };
            let bound = closed_above(&config);
            // Gates that no opacity closes have no bound.
            let never = gate(f64::INFINITY, &config) >= gate_min;
            assert_eq!(bound == f64::INFINITY, never, "{steepness}, {gate_min}");
            assert!(never || gate(bound, &config) < gate_min, "{steepness}, {gate_min}");
            assert!(
                bound == f64::INFINITY || gate(bound - 2.0 * SLACK, &config) >= gate_min,
                "{steepness}, {gate_min}"
            );
        }
    }
}
