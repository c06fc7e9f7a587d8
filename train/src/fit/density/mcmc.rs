//! Relocation under a budget: "3D Gaussian Splatting as Markov Chain Monte Carlo" (Kheradmand et al. 2024), sections 3.2 to
//! 3.4.
//!
//! - [`refine`]: dead Gaussians are relocated to live ones drawn by opacity, then the count grows by a share up to the cap. A
//!   Gaussian and its copies share opacity and scale (Eq. 9), so that the image does not change.
//! - [`perturb`]: after each step, the means get noise with the Gaussian's own covariance, gated to nearly transparent ones: `mean
//!   += Sigma n * rate * noise * sigmoid(100 (0.005 - opacity))` (Eq. 8), `n` standard normal.
//!
//! Departures: covariance and rate are in scene extents, which makes the noise independent of the scene's unit and equal to the
//! paper's at extent 1; the moments of both the live Gaussian and its copies are reset to zero.

use burn::tensor::{IndexingUpdateOp, Tensor};
use gs_burn::Gaussians;
use rayon::prelude::*;

use super::{Changes, Refinement, StepContext};
use crate::config::DensityConfig;
use crate::fit::density::ops::{Draft, sample, sigmoid};
use crate::fit::parameters::{Group, Table, from_host, indices, to_host};
use crate::fit::random::{Purpose, normal_triple, stream};
use gs_burn::adam::Adam;

/// Steepness of the gate over opacity (paper: k).
const GATE_STEEPNESS: f64 = 100.0;

/// Opacity at which the gate is half open (paper: t).
const GATE_OPACITY: f64 = 0.005;

/// A gate below this lets no noise through: it would move the Gaussian by less than a thousandth of the noise.
const GATE_MIN: f64 = 1e-3;

/// Gaussians that share one stream of random numbers, so that threads can draw in parallel.
const CHUNK: usize = 4096;

/// Relocates dead Gaussians to live ones and grows by `config.growth`, never above `config.cap`.
pub fn refine(gaussians: &mut Gaussians, adam: &mut Adam, config: &DensityConfig, context: &StepContext) -> Refinement {
    let mut rng = stream(context.seed, Purpose::Density, context.step as u64);
    let mut draft = Draft::read(gaussians);
    let before = draft.len();

    let (dead, alive): (Vec<usize>, Vec<usize>) = (0..before).partition(|row| {
        let opacity = draft.opacity(*row);
        opacity <= config.min_opacity || opacity.is_nan()
    });
    let weights: Vec<f64> = alive.iter().map(|row| draft.opacity(*row)).collect();
    let onto: Vec<usize> = sample(&weights, dead.len(), &mut rng).into_iter().map(|i| alive[i]).collect();
    draft.share_out(&onto, config.min_opacity);
    for (dead, onto) in dead.iter().zip(&onto) {
        draft.overwrite(*dead, *onto);
    }

    let wanted = ((before as f64 * (1.0 + config.growth)).round() as usize).min(config.cap);
    let weights: Vec<f64> = (0..before).map(|row| draft.opacity(row)).collect();
    let copied = sample(&weights, wanted.saturating_sub(before), &mut rng);
    draft.share_out(&copied, config.min_opacity);
    for row in &copied {
        draft.duplicate(*row);
    }

    let changes = Changes { added: copied.len(), moved: onto.len(), removed: 0 };
    let rows = (changes != Changes::default()).then(|| draft.commit(gaussians, adam));
    Refinement { changes, rows }
}

/// Adds the position noise of one step.
pub fn perturb(gaussians: &mut Gaussians, noise: f64, context: &StepContext) {
    // In scene units: the covariance over extent^2, times the extent.
    let strength = noise * context.means_lr / context.extent;
    if strength == 0.0 || gaussians.is_empty() {
        return;
    }
    let logits = gaussians.read(Group::Opacity);
    let gated: Vec<(u32, f64)> = gates(&logits);
    if gated.is_empty() {
        return;
    }
    let device = gaussians.device();
    let rows = indices(&gated.iter().map(|(row, _)| *row).collect::<Vec<_>>(), &device);
    let some = |group| -> Vec<f32> { to_host::<2>(gaussians.group(group).select(0, rows.clone())) };
    let (quats, log_scales) = (some(Group::Quats), some(Group::LogScales));
    let mut moves = vec![0.0f32; 3 * gated.len()];
    moves.par_chunks_mut(3 * CHUNK).enumerate().for_each(|(chunk, moves)| {
        // Below 2^56: steps under 2^36 and chunks under 2^20.
        let mut rng = stream(context.seed, Purpose::Noise, (context.step as u64) << 20 | chunk as u64);
        for (i, moved) in moves.chunks_exact_mut(3).enumerate() {
            let row = chunk * CHUNK + i;
            let quat = [0, 1, 2, 3].map(|c| f64::from(quats[4 * row + c]));
            let variances = [0, 1, 2].map(|c| (2.0 * f64::from(log_scales[3 * row + c])).exp());
            let offset = covariance_times(quat, variances, normal_triple(&mut rng)) * (strength * gated[row].1);
            // A Gaussian whose rotation or scale is not finite is not moved.
            let offset = if offset.is_finite() { offset.as_vec3() } else { glam::Vec3::ZERO };
            moved.copy_from_slice(&offset.to_array());
        }
    });
    let moves: Tensor<2> = from_host(moves, 3, &device);
    let means = gaussians.take(Group::Means);
    gaussians.set(Group::Means, means.select_assign(0, rows, moves, IndexingUpdateOp::Add));
}

/// Rows whose gate is open, with the gate.
fn gates(opacity_logits: &[f32]) -> Vec<(u32, f64)> {
    opacity_logits
        .iter()
        .enumerate()
        .map(|(row, logit)| (row as u32, sigmoid(GATE_STEEPNESS * (GATE_OPACITY - sigmoid(f64::from(*logit))))))
        .filter(|(_, gate)| *gate >= GATE_MIN)
        .collect()
}

/// `R diag(variances) R^T v` with R the rotation of the unnormalised quaternion w x y z.
fn covariance_times([w, x, y, z]: [f64; 4], variances: [f64; 3], v: glam::DVec3) -> glam::DVec3 {
    let rotation = glam::DMat3::from_quat(glam::DQuat::from_xyzw(x, y, z, w).normalize());
    rotation * (glam::DVec3::from(variances) * (rotation.transpose() * v))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::density::ops::logit;

    #[test]
    fn only_the_nearly_dead_are_gated() {
        let gates = gates(&[0.005, 0.9, 0.05, 0.2].map(|o| logit(o) as f32));
        assert_eq!(gates.iter().map(|(row, _)| *row).collect::<Vec<_>>(), [0, 2]);
        assert!((gates[0].1 - 0.5).abs() < 1e-3);
    }

    #[test]
    fn noise_has_the_shape_of_the_gaussian() {
        let turned = [0.5f64.sqrt(), 0.0, 0.0, 0.5f64.sqrt()]; // 90 degrees about z
        let moved = covariance_times(turned, [4.0, 1.0, 0.25], glam::DVec3::new(1.0, 1.0, 1.0));
        assert!((moved - glam::DVec3::new(1.0, 4.0, 0.25)).length() < 1e-12);
    }
}
