//! Golden figures: what 300 steps of five recipes (`static/base`; `taylormode/base`, `paper`, `itg` and `no-blur`) reach on a small world,
//! as the mean over three seeds. A change of the code that loses half a decibel fails here, and one that wins it has to write down the new
//! figures. The other recipes have no golden figures: they differ from these in their data or in single keys.
//!
//! Single runs scatter with the seed: by 0.13 dB over whole images (standard deviation within a recipe, pooled over the five recipes with
//! three seeds each, ten degrees of freedom) and by 0.035 dB over moving parts (four recipes, eight degrees). Numbers of another processor
//! round differently, which is no worse than another seed. Two means over three such runs then differ by less than
//! `t * deviation * sqrt(2 / 3)` in 99 of 100 cases, with t = 3.17 and 3.36.

mod common;

use std::path::{Path, PathBuf};

use gs_datasets::synthetic::deblur::{self, DeblurOptions, World};
use gs_datasets::synthetic::{DemoOptions, demo_scene};
use gs_train::pipelines::{Sources, resolve};

const SEEDS: [u64; 3] = [42, 43, 44];

/// Bounds on the means, dB.
const WHOLE: f64 = 0.34;
const MOVING: f64 = 0.10;

/// What the five recipes are asked with: few Gaussians and steps.
const SMALL: [&str; 8] = [
    "steps=300",
    "density.cap=1500",
    "density.start=30",
    "density.every=30",
    "eval.at=[]",
    "eval.images=1",
    "eval.ms_ssim=false",
    "eval.lpips=false",
];
const SMALL_MOTION: [&str; 2] = ["motion.points=400", "motion.select_every=50"];

/// Mean PSNR of held-out views over three seeds, dB: whole images, and moving parts.
struct Golden {
    recipe: &'static str,
    whole: f64,
    moving: Option<f64>,
}

/// Seeds 42, 43, 44: 25.23, 25.59, 25.20. As published, without the measures that follow the run: 20.37, 20.14, 20.17.
const STATIC: Golden = Golden { recipe: "static/base", whole: 25.34, moving: None };

/// Seeds 42, 43, 44, whole and moving:
///
/// | recipe | whole | moving |
/// |---|---|---|
/// | base | 22.73, 22.77, 23.09 | 17.44, 17.51, 17.52 |
/// | paper | 22.64, 22.71, 22.93 | 17.52, 17.43, 17.51 |
/// | itg | 22.63, 22.71, 22.73 | 17.02, 17.01, 17.02 |
/// | no-blur | 22.80, 22.74, 22.86 | 17.28, 17.31, 17.33 |
const MOTION: [Golden; 4] = [
    Golden { recipe: "taylormode/base", whole: 22.86, moving: Some(17.49) },
    Golden { recipe: "taylormode/paper", whole: 22.76, moving: Some(17.48) },
    Golden { recipe: "taylormode/itg", whole: 22.69, moving: Some(17.02) },
    Golden { recipe: "taylormode/no-blur", whole: 22.80, moving: Some(17.31) },
];

#[test]
fn photos_of_a_still_scene() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = temporary.path().join("photos");
    let options = DemoOptions { train_views: 12, test_views: 4, width: 64, height: 48, points: 400, seed: 1 };
    demo_scene(&data, &options).expect("the scene is written");
    STATIC.holds(&data, temporary.path(), &[]);
}

#[test]
fn blurry_video() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = video(temporary.path());
    let moving = MOTION.each_ref().map(|golden| golden.holds(&data, temporary.path(), &SMALL_MOTION));
    let [base, paper, itg, no_blur] = moving.map(|moving| moving.expect("moving parts"));
    // Both formations win where things move, by more than the means scatter.
    assert!(base > itg + MOVING && paper > itg + MOVING, "base {base}, paper {paper}, itg {itg} dB in moving parts");
    assert!(base > no_blur + MOVING, "base {base}, no blur model {no_blur} dB in moving parts");
}

fn video(folder: &Path) -> PathBuf {
    let path = folder.join("video");
    let options = DeblurOptions {
        world: World::Cube,
        width: 80,
        height: 60,
        cameras: 5,
        held_out: 1,
        frames: 6,
        subframes: 24,
        points: 600,
        ..DeblurOptions::default()
    };
    deblur::write(&path, &options, |_, _| {}).expect("the world is written");
    path
}

impl Golden {
    /// Trains with each seed, compares the means, and gives back that of the moving parts.
    fn holds(&self, data: &Path, folder: &Path, more: &[&str]) -> Option<f64> {
        let runs: Vec<[f64; 2]> = SEEDS.iter().map(|seed| self.trained(data, folder, more, *seed)).collect();
        let mean = |part: usize| runs.iter().map(|run| run[part]).sum::<f64>() / runs.len() as f64;
        let all = [("whole", mean(0), Some(self.whole), WHOLE), ("moving", mean(1), self.moving, MOVING)];
        for (part, mean, golden, bound) in all {
            let Some(golden) = golden else { continue };
            let what = format!("{}, {part}: {mean:.3} dB, golden {golden} +- {bound}; runs {runs:.3?}", self.recipe);
            assert!((mean - golden).abs() <= bound, "{what}");
        }
        self.moving.map(|_| mean(1))
    }

    fn trained(&self, data: &Path, folder: &Path, more: &[&str], seed: u64) -> [f64; 2] {
        let set = SMALL.iter().chain(more).map(|text| text.to_string()).chain([format!("seed={seed}")]);
        let overrides: Vec<String> = set.collect();
        let sources = Sources { recipe: Some(self.recipe), overrides: &overrides, ..Sources::default() };
        let config = resolve(sources).expect("valid").config;
        let run = folder.join(format!("{}-{seed}", self.recipe.replace('/', "-")));
        let last = common::finish(&common::job(data, &run, &config)).last;
        [last.mean().psnr, last.moving().map_or(f64::NAN, |scores| scores.psnr)]
    }
}
