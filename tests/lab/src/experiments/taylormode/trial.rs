//! A run of an experiment: the recipe of the small worlds, and access to a session's state.

use anyhow::Result;
use gs_datasets::Scene;
use gs_models::taylormode::TaylorScene;
use gs_pipelines::taylormode::Taylormode;

use crate::experiments::Lab;
use crate::experiments::lab::{Session, Trial};

/// The part of the recipe that a static scene shares.
pub const SHARED: [&str; 15] = [
    "model.sh_degree=0",
    "density.cap=2500",
    "density.start=30",
    "density.every=30",
    "density.mcmc.growth=0.1",
    "density.prune_share=0.005",
    "optimiser.means_lr=8e-4",
    "optimiser.means_lr_final=2e-5",
    "optimiser.quats_lr=4e-3",
    "optimiser.scales_lr=1.5e-2",
    "optimiser.sh_lr=1e-2",
    "optimiser.opacity_lr=0.1",
    "eval.ms_ssim=false",
    "eval.lpips=false",
    "data.cache_mb=256",
];

/// The common recipe of all runs on the small worlds: few Gaussians and few instants, because the images are small, and
/// learning rates of the Gaussians several times higher than in a real run, because a few hundred steps must make a
/// scene sharp enough for blur to matter. The rest is the base recipe.
const MOVING: [&str; 3] = ["motion.points=800", "motion.select_every=50", "blur.samples=5"];

/// A run of the recipe of the small worlds with changes.
pub fn trial(lab: &Lab, scene: &Scene, changes: &[&str]) -> Result<Trial<Taylormode>> {
    Trial::new(lab, scene.clone(), &[&SHARED[..], &MOVING, changes].concat())
}

impl Session<'_, Taylormode> {
    /// The module of the method.
    pub fn method(&self) -> &Taylormode {
        self.fit.trainer.method()
    }

    /// The moving scene.
    pub fn scene(&self) -> TaylorScene {
        self.method().moving_scene(self.fit.trainer.gaussians().clone())
    }
}
