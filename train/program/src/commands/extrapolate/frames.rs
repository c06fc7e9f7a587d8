//! Frames, animations and PLY files of the times that were asked for; the scene with another step of integration.

use anyhow::{Result, bail};
use gs_base::counted;
use serde::Serialize;

use super::Work;
use crate::cli::ExtrapolateArgs;
use crate::commands::print;
use crate::report::maps::write_gif;
use gs_train::fit::extrapolation::Extrapolation;
use gs_train::fit::parameters::to_host;
use gs_train::fit::times::through_time;
use gs_train::run::outputs::write_png;
use gs_train::run::pixels::image_bytes;
use gs_train::run::scene::write_ply;

/// The changes by another step of integration.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StepNote {
    /// Its length, frames.
    pub frames: f64,
    /// Largest distance of a Gaussian from where the trained step leads it, scene units.
    pub largest: f64,
    /// The same in pixels of the first camera.
    pub largest_pixels: f64,
}

/// The future with another step of integration, if one is asked for.
///
/// # Errors
/// A sentence, when the run has no steps or the length is not usable.
pub fn stepped(args: &ExtrapolateArgs, future: Option<&dyn Extrapolation>) -> Result<Option<Box<dyn Extrapolation>>> {
    match (args.step, future) {
        (None, _) => Ok(None),
        (Some(frames), Some(future)) => match future.with_step(frames) {
            Ok(stepped) => Ok(Some(stepped)),
            Err(expected) => bail!("--step: {expected}"),
        },
        (Some(_), None) => bail!("--step: expected a run whose motion is integrated, found one of another pipeline"),
    }
}

impl Work<'_> {
    /// Writes frames, animations and PLY files.
    pub(super) fn frames(&self) -> Result<()> {
        let mut animations = vec![Vec::new(); self.shots.len()];
        for (index, gaussians) in through_time(self.predicted.scene, &self.times).enumerate() {
            for (shot, animation) in self.shots.iter().zip(&mut animations) {
                let pose = shot.pose(index);
                let pixels = image_bytes(self.predicted.renderer.image(&gaussians, pose));
                write_png(&self.files.frame(shot, index), [pose.width, pose.height], &pixels)?;
                animation.push(pixels);
            }
            if self.args.ply {
                write_ply(&self.files.ply(&self.run_name(), self.times[index]), &gaussians, self.loaded.origin)?;
            }
        }
        for (shot, animation) in self.shots.iter().zip(&animations) {
            let pose = shot.pose(0);
            write_gif(&self.files.animation(shot), pose.width, pose.height, animation)?;
        }
        let [from, to] = [self.times[0], *self.times.last().unwrap_or(&self.args.to)];
        print(format!("{} from {from} to {to}, seen up to {}", counted(self.times.len(), "frame"), self.span[1]));
        Ok(())
    }

    /// The largest change of a position by the step that was asked for.
    pub(super) fn step_note(&self) -> Result<Option<StepNote>> {
        let Some(frames) = self.args.step else { return Ok(None) };
        let mut largest: f64 = 0.0;
        let trained = through_time(&*self.loaded.scene, &self.times);
        for (a, b) in through_time(self.predicted.scene, &self.times).zip(trained) {
            let [a, b] = [a, b].map(|gaussians| to_host(gaussians.means.val()));
            let squared = |(a, b): (&[f32], &[f32])| -> f64 {
                a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum()
            };
            let most = a.chunks_exact(3).zip(b.chunks_exact(3)).map(squared).fold(0.0, f64::max);
            largest = largest.max(most.sqrt());
        }
        let note = StepNote { frames, largest, largest_pixels: largest / self.pixel };
        print(format!(
            "steps of {frames} frames move a Gaussian by at most {:.3} pixels from where the trained step leads it",
            note.largest_pixels
        ));
        Ok(Some(note))
    }
}
