//! Small streets to train on.

use std::path::{Path, PathBuf};

use gs_train::run::watch::Job;
use gs_worlds::driving::{StreetOptions, write};

/// Streets of one second with one small camera.
pub fn streets(folder: &Path, logs: u64) -> PathBuf {
    let path = folder.join("streets");
    for seed in 0..logs {
        write(&path.join(format!("{seed:03}")), &small_street(11, seed), |_, _| {}).expect("written");
    }
    path
}

/// A street of small images with many movers.
pub fn small_street(frames: usize, seed: u64) -> StreetOptions {
    StreetOptions {
        frames,
        cameras: 1,
        width: 64,
        height: 36,
        beams: 16,
        columns: 450,
        subpixels: 1,
        movers: 12,
        seed,
        ..StreetOptions::default()
    }
}

/// A network and snippets that take a second or less a step.
pub const SMALL: [&str; 6] = [
    "pipeline=flux4d",
    "lift.points=1500",
    "lift.sky_points=100",
    "unet.width=0.1",
    "unet.voxel=1.0",
    "refinement.passes=2",
];

/// A run on streets.
pub fn job(data: &Path, folder: &Path, steps: usize, overrides: &[&str]) -> Job {
    let all: Vec<&str> = SMALL.into_iter().chain(overrides.iter().copied()).collect();
    super::job(data, folder, &super::config(steps, &all))
}
