//! A network applied to a snippet: the passes over its input images.

use std::time::Instant;

use anyhow::{Result, anyhow};
use burn::tensor::{Device, Tensor};
use gs_driving::DrivingLog;
use gs_models::flux4d::FluxScene;
use gs_models::flux4d::activate_within;

use super::config::FluxConfig;
use super::network::FluxNetwork;
use super::prepare::HostSnippet;
use super::sample::{Sample, Supervision, target};
use gs_train::fit::parameters::{from_host, to_host};

/// A snippet after the passes of a network.
#[derive(Debug, Clone)]
pub struct Inferred {
    /// The snippet.
    pub sample: Sample,
    /// Raw channels after the last pass, `[N, 14]`.
    pub raw: Tensor<2>,
    /// `[N, 3 (l + 1)]`, metres per window.
    pub velocity: Tensor<2>,
    /// Seconds for sending the snippet and building its maps.
    pub map_seconds: f64,
    /// Seconds for all passes, with the renderings whose gradients are fed back.
    pub pass_seconds: f64,
}

impl Inferred {
    /// The Gaussians with their motion; those slower than `rest_speed` (m/s) at all times rest.
    ///
    /// # Errors
    /// When a velocity is not finite.
    pub fn scene(&self, host: &HostSnippet, rest_speed: f64) -> Result<FluxScene> {
        let gaussians = activate_within(self.raw.clone(), &self.sample.lifted.limits);
        let (velocity, motion) = (self.velocity.clone(), self.sample.frame.motion);
        Ok(FluxScene::new(gaussians, velocity, &host.rows.times, motion, host.window, rest_speed)?)
    }
}

impl Inferred {
    /// Takes over the velocities of a scene that was made of it.
    pub fn follow(&mut self, scene: &FluxScene) {
        if scene.moving() == 0 {
            return;
        }
        let columns = scene.motion.columns();
        let mut all = to_host(self.velocity.clone());
        let moving = scene.rows[scene.resting()..].iter();
        for (row, own) in moving.zip(to_host(scene.velocity.val()).chunks_exact(columns)) {
            all[columns * *row as usize..columns * (*row as usize + 1)].copy_from_slice(own);
        }
        self.velocity = from_host(all, columns, &self.velocity.device());
    }
}

/// Applies a network without autodiff: its passes read gradients of renderings and keep no graph of their own. The
/// gradients of all input images are fed back, in training those of a few.
///
/// # Errors
/// A sentence: a point too far for the voxels, a loss that is not finite.
pub fn infer(
    network: &FluxNetwork,
    host: &HostSnippet,
    log: &DrivingLog,
    config: &FluxConfig,
    device: &Device,
) -> Result<Inferred> {
    let begun = Instant::now();
    let sample = Sample::new(host, config, device)?;
    let map_seconds = begun.elapsed().as_secs_f64();
    let begun = Instant::now();
    let inputs = host.inputs.iter().map(|view| target(log, view, device)).collect();
    let supervision =
        Supervision { frame: &sample.frame, inputs, targets: Vec::new(), host: Some(host), loss: config.loss() };
    let (raw, times) = (sample.lifted.raw.clone(), sample.lifted.times.clone());
    let refined = network.bound(&sample, config, |refinement| refinement.infer(raw, times, &supervision));
    let refined = refined.map_err(|error| anyhow!("snippet {}: {error}", host.name))?;
    let pass_seconds = begun.elapsed().as_secs_f64();
    drop(supervision);
    let velocity = sample.frame.velocity(refined.velocity);
    Ok(Inferred { raw: refined.raw, velocity, sample, map_seconds, pass_seconds })
}
