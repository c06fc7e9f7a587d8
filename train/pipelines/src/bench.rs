//! One training step of each kind that `gsburn bench` takes, on Gaussians that it is given.

use gs_burn::{Camera, Gaussians};

use super::still::Still;
use super::taylormode::bench as taylormode;
use gs_train::config::Strategy;
use gs_train::fit::bench::{Steps, photo_of, steps};
use gs_train::fit::depth::PhotoDepth;
use gs_train::fit::intake::Intake;
use gs_train::fit::trainer::Model;

/// A kind of training step.
pub struct BenchStep {
    /// The pipeline, and what of its configuration matters.
    pub name: &'static str,
    /// The training of these Gaussians on one photo by this camera.
    pub begin: fn(Gaussians, &Camera) -> Steps,
}

/// All kinds; the first is the one that is timed.
pub static BENCH_STEPS: [BenchStep; 4] = [
    BenchStep { name: "static, density.strategy = mcmc", begin: |scene, camera| still(scene, camera, Strategy::Mcmc) },
    BenchStep {
        name: "static, density.strategy = default",
        begin: |scene, camera| still(scene, camera, Strategy::Default),
    },
    BenchStep { name: "taylormode, blur.mode = integrate", begin: taylormode::integrate },
    BenchStep { name: "taylormode, blur.mode = warp", begin: taylormode::warp },
];

fn still(gaussians: Gaussians, camera: &Camera, strategy: Strategy) -> Steps {
    let photo = photo_of(&gaussians, camera, PhotoDepth::default());
    let mut config = Still::defaults();
    config.shared.density.strategy = strategy;
    steps(Model::uncorrected(gaussians, Still {}), photo, config)
}
