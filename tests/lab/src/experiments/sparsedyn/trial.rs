//! Runs of the experiments: a small world filmed once, cut into what is seen and what is to be predicted, the recipe,
//! and scores by time.

use anyhow::Result;
use gs_datasets::{Scene, Split, View};
use gs_pipelines::sparsedyn::Sparsedyn;
use gs_train::fit::told::{MOVING, given_regions};
use gs_train::run::evaluate::{Evaluator, HeldOut};
use gs_worlds::extrapolation::{ExtrapolationOptions, PriorErrors, World};

use crate::experiments::Lab;
use crate::experiments::lab::{Session, Trial};

/// Width and height of the images, pixels.
const SIZE: usize = 80;

/// The last time that most experiments see.
pub const SEEN: f64 = 0.75;

/// Times closer than this are one.
pub const SAME_TIME: f64 = 1e-6;

/// The recipe of the small worlds: few Gaussians, because images are small, and twice the rates of motion, because a
/// quarter of the steps of a real run must do. The rest is the base recipe.
const RECIPE: [&str; 6] = [
    "density.cap=3000",
    "dynamics.lr=1e-2",
    "bodies.lr=1e-2",
    "eval.ms_ssim=false",
    "eval.lpips=false",
    "data.cache_mb=256",
];

/// The options of a small world with exact priors: 6 training cameras all around and 2 between them, 24 frames over 1
/// unit of time.
pub fn small(world: World) -> ExtrapolationOptions {
    ExtrapolationOptions {
        width: SIZE,
        height: SIZE,
        cameras: 8,
        held_out: 2,
        frames: 24,
        truth_every: 1000,
        priors: PriorErrors::none(),
        ..ExtrapolationOptions::of(world)
    }
}

/// The time of a view.
pub fn time(view: &View) -> f64 {
    view.time.unwrap_or(0.0)
}

/// All photos of a world.
pub struct Film {
    scene: Scene,
    /// Photos of the training cameras, at all times.
    pub train: Vec<View>,
    /// Photos of the held-out cameras, at all times.
    pub test: Vec<View>,
    /// Names of the training cameras, around the scene.
    cameras: Vec<String>,
}

impl Film {
    /// Films a world, or reads it if that was done before.
    pub fn of(lab: &Lab, options: &ExtrapolationOptions) -> Result<Self> {
        let mut scene = lab.future_world(options)?;
        let mut cameras: Vec<String> = scene.train.iter().filter_map(|view| view.camera_id.clone()).collect();
        cameras.sort();
        cameras.dedup();
        let held_out = std::mem::take(&mut scene.held_out).into_iter().flat_map(|split| split.views);
        let views = std::mem::take(&mut scene.train).into_iter().chain(held_out);
        let (train, test) = views.partition(|view| view.camera_id.as_ref().is_some_and(|id| cameras.contains(id)));
        Ok(Self { scene, train, test, cameras })
    }

    /// The data set of the first photos up to the time `seen`, by `count` training cameras spread evenly. Points are
    /// those of the priors of these cameras alone.
    pub fn seen(&self, count: usize, seen: f64) -> Scene {
        let count = count.min(self.cameras.len());
        let chosen: Vec<&String> = (0..count).map(|index| &self.cameras[index * self.cameras.len() / count]).collect();
        let is_chosen = |view: &&View| view.camera_id.as_ref().is_some_and(|id| chosen.contains(&id));
        let train = self.train.iter().filter(|view| time(view) <= seen + SAME_TIME).filter(is_chosen);
        Scene {
            train: train.cloned().collect(),
            held_out: vec![Split { name: Split::TEST.into(), views: self.future(seen, f64::INFINITY) }],
            points: None,
            ..self.scene.clone()
        }
    }

    /// The data set of all training cameras up to the time `seen`.
    pub fn until(&self, seen: f64) -> Scene {
        self.seen(self.cameras.len(), seen)
    }

    /// Photos of the held-out cameras after the time `from` and up to `to`.
    pub fn future(&self, from: f64, to: f64) -> Vec<View> {
        let within = |view: &&View| time(view) > from + SAME_TIME && time(view) <= to + SAME_TIME;
        self.test.iter().filter(within).cloned().collect()
    }
}

/// A run of the recipe with changes on `scene`.
pub fn trial(lab: &Lab, scene: Scene, changes: &[&str]) -> Result<Trial<Sparsedyn>> {
    Trial::new(lab, scene, &[&RECIPE, changes].concat())
}

/// The scores of a photo.
#[derive(Debug, Clone, Copy)]
pub struct Score {
    pub time: f64,
    /// PSNR over the image, dB.
    pub psnr: f64,
    /// PSNR over moving parts, dB; NaN if none is seen.
    pub moving: f64,
}

/// The scores of `views` now.
pub fn scores(lab: &Lab, session: &Session<Sparsedyn>, views: &[View]) -> Vec<Score> {
    let (fit, at) = (&session.fit, session.fit.at());
    let held_out = HeldOut { split: Split::TEST, views, regions: views.iter().map(given_regions).collect() };
    let evaluator = Evaluator::new(&fit.config.eval, &lab.device);
    let measured = evaluator.measure(fit.trainer.model(), &fit.data.scene, &held_out, &at, 0).0;
    let found = measured.quality.views.into_iter().filter_map(|scored| {
        let view = views.iter().find(|view| view.name == scored.name)?;
        let moving = scored.regions.get(MOVING).map_or(f64::NAN, |scores| scores.psnr);
        Some(Score { time: time(view), psnr: scored.scores.psnr, moving })
    });
    found.collect()
}

/// The mean of those values that are numbers; NaN without one.
pub fn mean(values: impl IntoIterator<Item = f64>) -> f64 {
    let (sum, count) = values.into_iter().filter(|x| !x.is_nan()).fold((0.0, 0.0), |(sum, n), x| (sum + x, n + 1.0));
    sum / count
}

/// Mean PSNR over the images and over moving parts, dB.
pub fn means(scores: &[Score]) -> [f64; 2] {
    [mean(scores.iter().map(|score| score.psnr)), mean(scores.iter().map(|score| score.moving))]
}

/// The mean of `value` over the photos of each time, times ascending.
pub fn over_time(scores: &[Score], value: impl Fn(&Score) -> f64) -> Vec<(f64, f64)> {
    let mut times: Vec<f64> = scores.iter().map(|score| score.time).collect();
    times.sort_by(f64::total_cmp);
    times.dedup_by(|a, b| (*a - *b).abs() < SAME_TIME);
    let mean_at = |time: f64| mean(scores.iter().filter(|score| (score.time - time).abs() < SAME_TIME).map(&value));
    times.into_iter().map(|time| (time, mean_at(time))).collect()
}

/// The positions of all Gaussians at `times`, scene units.
pub fn positions(session: &Session<Sparsedyn>, times: &[f64]) -> Vec<Vec<glam::DVec3>> {
    let scenes = session.fit.trainer.scene().at_times(times);
    let host = |gaussians: gs_burn::Gaussians| -> Vec<glam::DVec3> {
        let values = gs_train::fit::parameters::to_host(gaussians.means.val());
        values.chunks_exact(3).map(|x| glam::Vec3::from_slice(x).as_dvec3()).collect()
    };
    scenes.into_iter().map(host).collect()
}
