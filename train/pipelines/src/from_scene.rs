//! The state before the first step of a training that goes on from a scene (`init.scene`).

use std::path::Path;

use anyhow::{Result, ensure};
use burn::module::Param;
use burn::tensor::Device;
use gs_burn::Gaussians;
use gs_train::config::FitConfig;
use gs_train::fit::camera_paths::CameraPaths;
use gs_train::fit::correction::Correction;
use gs_train::fit::density::ops::Draft;
use gs_train::fit::intake::Intake;
use gs_train::fit::method::Step;
use gs_train::fit::saved::Saved;
use gs_train::fit::session::Data;
use gs_train::fit::trainer::{Model, Trainer};
use gs_train::run::scene::translated;

use super::load_scene;

/// The state before the first step; `None` where no scene is named.
///
/// # Errors
/// A sentence when the scene cannot be read, or has more Gaussians than the training may.
pub fn from_scene<M: Intake + Saved>(
    data: &Data<M>,
    config: &FitConfig<M::Config>,
    device: &Device,
) -> Result<Option<Trainer<M>>> {
    let path = Path::new(&config.init.scene);
    if config.init.scene.is_empty() {
        return Ok(None);
    }
    let loaded = load_scene(path, device)?;
    let (count, cap) = (loaded.gaussians.len(), config.density.cap);
    ensure!(
        count <= cap,
        "{}: expected at most density.cap = {cap} Gaussians to go on from, found {count}; --set density.cap={count} \
         takes all",
        path.display()
    );
    ensure!(count > 0, "{}: expected Gaussians to go on from, found none", path.display());
    let at = Step { step: 0, config, facts: &data.facts, cues: &data.cues, room: None };
    let method = M::at_rest(&data.scene, &at, device).map_err(anyhow::Error::msg)?;
    // Both have their own origin subtracted.
    let placed = translated(&loaded.gaussians, loaded.origin - data.scene.origin);
    let gaussians = cut(placed, config.model.sh_degree);
    let correction = Correction::begin(&data.scene.train, &Draft::read(&gaussians).means, &config.correction, device);
    let cameras = CameraPaths::begin(&data.scene.train, &data.facts, config, device);
    Ok(Some(Trainer::from_model(Model { gaussians, correction, cameras, method }, data.facts, config)))
}

/// The Gaussians with harmonics up to `degree` only.
fn cut(gaussians: Gaussians, degree: usize) -> Gaussians {
    let sh = gaussians.sh.val();
    let [count, coefficients, channels] = sh.dims();
    let kept = coefficients.min((degree + 1).pow(2));
    Gaussians { sh: Param::from_tensor(sh.slice([0..count, 0..kept, 0..channels])), ..gaussians }
}
