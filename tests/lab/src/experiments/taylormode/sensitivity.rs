//! The cost of heuristics of inference that are wrong by a factor of two. Each is halved and doubled, on
//! synthetic worlds and on a data set of the user.

use anyhow::Result;
use gs_datasets::{Priors, Scene, load};
use gs_pipelines::taylormode::Taylormode;
use gs_pipelines::taylormode::config::CuesConfig;
use gs_pipelines::taylormode::cues;
use gs_worlds::deblur::{DeblurOptions, PriorFaults, World};

use super::trial::trial;
use crate::experiments::lab::{Trial, moving_psnr, small};
use crate::experiments::{Findings, Lab, Series};

/// Steps on the user's data set, which is larger.
const STEPS_REAL: &str = "steps=1000";

/// Width of the user's photos, pixels: about the reference width of the heuristics.
const WIDTH_REAL: &str = "data.max_width=320";

/// Largest change by a heuristic, dB, above which it should be derived from the data instead.
const BOUND: f64 = 0.3;

/// Seeds of the unchanged heuristics, whose spread is the noise.
const SEEDS: [u64; 3] = [42, 43, 44];

/// A heuristic: its key, its value, and its range.
type Heuristic = (&'static str, fn(&CuesConfig) -> f64, [f64; 2]);

const HEURISTICS: [Heuristic; 8] = [
    ("near_share", |cues| cues.near_share, [0.01, 0.9]),
    ("plain_nearest", |cues| cues.plain_nearest, [0.3, 2.9]),
    ("body_size", |cues| cues.body_size, [1e-4, 0.1]),
    ("followed", |cues| cues.followed, [1e-4, 0.1]),
    ("unseen", |cues| cues.unseen, [1e-5, 0.1]),
    ("turn", |cues| cues.turn, [0.0, 100.0]),
    ("shadow", |cues| cues.shadow, [0.0, 2.0]),
    ("speck", |cues| cues.speck, [0.0, 0.01]),
];

/// A scene with its name and its changes of the recipe.
struct Ground {
    name: &'static str,
    scene: Scene,
    changes: Vec<&'static str>,
    /// Whether the recipe of the small worlds applies.
    is_small: bool,
}

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    for ground in grounds(lab)? {
        let unchanged: Vec<[f64; 2]> =
            SEEDS.iter().map(|seed| psnr(lab, &ground, &format!("seed={seed}"))).collect::<Result<_>>()?;
        let (base, name) = (unchanged[0], ground.name);
        let spread = [0, 1].map(|part| {
            let all = unchanged.iter().map(|psnr| psnr[part]);
            all.clone().fold(f64::NEG_INFINITY, f64::max) - all.fold(f64::INFINITY, f64::min)
        });
        found.note(format!(
            "{name}: {:.2} dB over the image and {:.2} dB in moving parts; three seeds spread by {:.2} and {:.2} dB.",
            base[0], base[1], spread[0], spread[1]
        ));
        let mut series = Vec::new();
        for (key, value, [low, high]) in HEURISTICS {
            let usual = value(&CuesConfig::default());
            let mut changes = Vec::new();
            for factor in [0.5, 2.0] {
                let changed = (factor * usual).clamp(low, high);
                let psnr = psnr(lab, &ground, &format!("cues.{key}={changed:e}"))?;
                changes.push([psnr[0] - base[0], psnr[1] - base[1]]);
            }
            let [[half_whole, half], [double_whole, double]] = [changes[0], changes[1]];
            found.note(format!(
                "{name}, {key}: halved {half_whole:+.2} dB ({half:+.2} moving), doubled {double_whole:+.2} dB \
                 ({double:+.2} moving)."
            ));
            let worst = half.abs().max(double.abs()).max(half_whole.abs()).max(double_whole.abs());
            let what = format!("{name}, {key}: largest change when halved or doubled");
            found.at_most(what, worst, BOUND, "dB");
            series.push(Series::line_and_dots(key, vec![(-1.0, half), (0.0, 0.0), (1.0, double)]));
        }
        let title = format!("Heuristics halved and doubled, {name}");
        found.chart(name, title, ["log2 of the factor", "change of PSNR in moving parts, dB"], series);
    }
    Ok(())
}

/// Photos alone: without points and priors everything must be inferred.
fn grounds(lab: &Lab) -> Result<Vec<Ground>> {
    let alone = |world, ring| DeblurOptions { points: 0, ring, priors: PriorFaults::none(), ..small(world, 8) };
    let own = |name, options: &DeblurOptions| -> Result<Ground> {
        let mut scene = lab.world(options)?;
        scene.train.iter_mut().for_each(|view| view.priors = Priors::default());
        Ok(Ground { name, scene, changes: Vec::new(), is_small: true })
    };
    let mut grounds = vec![own("arc", &alone(World::Cube, false))?, own("ring", &alone(World::Sphere, true))?];
    if let Some(path) = &lab.data {
        let scene = load(path, &lab.config::<Taylormode>(&[WIDTH_REAL])?.data.options())?;
        // A data set that states no exposure is taken for sharp video.
        let sharp = scene.train.iter().all(|view| view.exposure.is_none());
        let blur = ["blur.mode=none", "blur.learn_exposure=false"];
        let mut changes = vec![WIDTH_REAL, STEPS_REAL, "eval.ms_ssim=false", "eval.lpips=false"];
        changes.extend(blur.into_iter().filter(|_| sharp));
        grounds.push(Ground { name: "data", scene, changes, is_small: false });
    }
    Ok(grounds)
}

/// PSNR over the whole image and in moving parts, with one change of the configuration.
fn psnr(lab: &Lab, ground: &Ground, change: &str) -> Result<[f64; 2]> {
    let changes: Vec<&str> = ground.changes.iter().copied().chain([change]).collect();
    let mut scene = ground.scene.clone();
    cues::leave_out_timeless(&mut scene);
    let trial = match ground.is_small {
        true => trial(lab, &scene, &changes)?,
        false => Trial::new(lab, scene, &changes)?,
    };
    let measured = trial.measured(lab)?;
    Ok([measured.quality.mean.psnr, moving_psnr(&measured)])
}
