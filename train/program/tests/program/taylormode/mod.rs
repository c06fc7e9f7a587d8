//! The pipeline for blurry video.

use crate::common;

#[cfg(any(feature = "ndarray", feature = "wgpu", feature = "vulkan", feature = "metal", feature = "cuda"))]
mod backends;
mod data;
mod formations;
mod resume;
mod selection;

use std::path::{Path, PathBuf};

use gs_train::run::folder::EvalFile;
use gs_train::run::watch::Job;
use gs_worlds::deblur::{self, DeblurOptions, World};

const STEPS: usize = 40;

/// A set of four cameras, one held out, and five frames.
fn tiny_world(folder: &Path) -> PathBuf {
    written(folder, DeblurOptions { world: World::Sphere, ..DeblurOptions::default() })
}

/// Writes a world as small as that, otherwise as `options` say.
fn written(folder: &Path, options: DeblurOptions) -> PathBuf {
    let path = folder.join("world");
    let options = DeblurOptions { width: 64, height: 48, cameras: 5, held_out: 1, frames: 5, ..options };
    deblur::write(&path, &options, |_, _| {}).expect("the world is written");
    path
}

const OVERRIDES: [&str; 9] = [
    "pipeline=taylormode",
    "model.sh_degree=1",
    "density.start=4",
    "density.every=10",
    "density.mcmc.growth=0.2",
    "density.cap=1500",
    "motion.points=200",
    "motion.select_every=10",
    "blur.samples=3",
];

fn config(more: &[&str]) -> toml::Table {
    common::config(STEPS, &[&OVERRIDES[..], more].concat())
}

fn job(world: &Path, folder: &Path, more: &[&str]) -> Job {
    common::job(world, folder, &config(more))
}

fn finish_in(folder: &Path, world: &Path, name: &str, more: &[&str]) -> EvalFile {
    common::finish(&job(world, &folder.join(name), more))
}
