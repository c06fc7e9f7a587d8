//! Golden figures: what 300 steps of five recipes (`static/base`; `taylormode/base`, `paper`, `itg` and `no-blur`)
//! reach on a small world, as the mean over three seeds. A change of the code that loses half a decibel fails here, and
//! one that wins it has to write down the new figures. The other recipes have no golden figures: they differ from these
//! in their data or in single keys.
//!
//! Single runs scatter with the seed: by 0.13 dB over whole images (standard deviation within a recipe, pooled over the
//! five recipes with three seeds each, ten degrees of freedom) and by 0.035 dB over moving parts (four recipes, eight
//! degrees). Numbers of another processor round differently, which is no worse than another seed. Two means over three
//! such runs then differ by less than `t * deviation * sqrt(2 / 3)` in 99 of 100 cases, with t = 3.17 and 3.36.

use crate::common;

use std::path::{Path, PathBuf};

use gs_pipelines::{Sources, resolve};
use gs_worlds::deblur::{self, DeblurOptions, World};
use gs_worlds::{DemoOptions, demo_scene};

const SEEDS: [u64; 3] = [42, 43, 44];

/// Bounds on the means, dB.
const WHOLE: f64 = 0.34;
const MOVING: f64 = 0.10;

/// The overrides of the five recipes: few Gaussians and steps.
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

/// The scores that a recipe reached.
struct Held {
    /// Mean PSNR of moving parts, dB.
    moving: Option<f64>,
    /// A sentence for each figure beyond its bound.
    misses: Vec<String>,
}

/// Seeds 42, 43, 44: 26.92, 26.93, 26.84. With copies that coincide: 25.23, 25.59, 25.20; as published, also without
/// the measures that follow the run: 20.37, 20.14, 20.17.
const STATIC: Golden = Golden { recipe: "static/base", whole: 26.90, moving: None };

/// Seeds 42, 43, 44, whole and moving:
///
/// | recipe | whole | moving |
/// |---|---|---|
/// | base | 23.82, 23.68, 23.98 | 17.74, 17.93, 18.04 |
/// | paper | 23.66, 23.78, 23.81 | 18.25, 18.15, 18.33 |
/// | itg | 23.46, 23.49, 23.64 | 17.17, 17.19, 17.22 |
/// | no-blur | 23.63, 23.58, 23.75 | 17.40, 17.46, 17.51 |
///
/// With the published rates in a short run their means were 23.14, 23.08, 23.10 and 23.04, and 17.56, 17.64, 17.11 and
/// 17.38; with copies that coincide, besides, 22.86, 22.76, 22.69 and 22.80, and 17.49, 17.48, 17.02 and 17.31.
const MOTION: [Golden; 4] = [
    Golden { recipe: "taylormode/base", whole: 23.83, moving: Some(17.91) },
    Golden { recipe: "taylormode/paper", whole: 23.75, moving: Some(18.24) },
    Golden { recipe: "taylormode/itg", whole: 23.53, moving: Some(17.19) },
    Golden { recipe: "taylormode/no-blur", whole: 23.65, moving: Some(17.46) },
];

#[test]
fn photos_of_a_still_scene() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = temporary.path().join("photos");
    let options = DemoOptions { train_views: 12, test_views: 4, width: 64, height: 48, points: 400, seed: 1 };
    demo_scene(&data, &options).expect("the scene is written");
    let Held { misses, .. } = STATIC.holds(&data, temporary.path(), &[]);
    assert!(misses.is_empty(), "{misses:#?}");
}

#[test]
fn blurry_video() {
    let temporary = tempfile::tempdir().expect("a folder");
    let data = video(temporary.path());
    let held = MOTION.each_ref().map(|golden| golden.holds(&data, temporary.path(), &SMALL_MOTION));
    let misses: Vec<&String> = held.iter().flat_map(|held| &held.misses).collect();
    assert!(misses.is_empty(), "{misses:#?}");
    let [base, paper, itg, no_blur] = held.map(|held| held.moving.expect("moving parts"));
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
    fn holds(&self, data: &Path, folder: &Path, more: &[&str]) -> Held {
        let runs: Vec<[f64; 2]> = SEEDS.iter().map(|seed| self.trained(data, folder, more, *seed)).collect();
        let mean = |part: usize| runs.iter().map(|run| run[part]).sum::<f64>() / runs.len() as f64;
        let all = [("whole", mean(0), Some(self.whole), WHOLE), ("moving", mean(1), self.moving, MOVING)];
        // All are printed before the first miss ends the test, since new figures are written down together.
        let mut misses: Vec<String> = Vec::new();
        for (part, mean, golden, bound) in all {
            let Some(golden) = golden else { continue };
            let what = format!("{}, {part}: {mean:.3} dB, golden {golden} +- {bound}; runs {runs:.3?}", self.recipe);
            println!("{what}");
            misses.extend(((mean - golden).abs() > bound).then_some(what));
        }
        Held { moving: self.moving.map(|_| mean(1)), misses }
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
