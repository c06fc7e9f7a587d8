//! Held-out snippets: the images between the inputs against photos, beside the lifted Gaussians, and the flow.

use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::{Result, bail};
use burn::tensor::{Device, Tensor};
use glam::DVec3;
use gs_burn::{Camera, Gaussians, Rendering};
use gs_driving::DrivingLog;
use gs_models::DynamicScene;
use gs_models::flux4d::actors::{ActorConfig, find_actors};
use gs_models::flux4d::losses::COVERED;
use gs_models::flux4d::scene::REST_SPEED;

use super::config::FluxConfig;
use super::feed::prepared;
use super::flow::Mean;
use super::host_view::HostView;
use super::infer::{Inferred, infer};
use super::label_scores::LabelScores;
use super::logs::{Logs, Place};
use super::moving;
use super::network::FluxNetwork;
use super::prepare::HostSnippet;
use super::sample::{camera, photo};
use super::snippet_page;
use super::world::in_world;
use gs_train::fit::figure::{Better, Figure};
use gs_train::fit::parameters::to_host;
use gs_train::fit::photos::image_tensor;
use gs_train::fit::told::MOVING;
use gs_train::run::evaluate::{Comparison, Evaluator, scores_within};
use gs_train::run::measured::{Measured, ModelSize, ViewScores};
use gs_train::run::metrics::{mean, psnr, psnr_masked};
use gs_train::run::pixels::velocity_colors;
use gs_train::run::presentation::PresentedScene;
use gs_train::sentence::one_sentence;

/// A measured network.
pub struct Measurement {
    /// Figures.
    pub measured: Measured,
    /// Pictures of some views.
    pub pictures: Vec<Comparison>,
    /// The first snippet at its middle time, with its origin in the world.
    pub scene: Option<(Gaussians, DVec3)>,
    /// The first snippet for the viewer.
    pub viewed: Option<PresentedScene>,
}

/// The snippets to measure.
pub struct Split<'a> {
    /// The logs.
    pub logs: &'a Arc<Logs>,
    /// The snippets.
    pub places: &'a [Place],
    /// The split's name.
    pub name: &'a str,
    /// Views of which pictures are kept.
    pub pictures: usize,
}

/// A measurement under way.
struct Measuring<'a> {
    evaluator: Evaluator,
    clustering: ActorConfig,
    /// Whether pictures are kept, and of every how many views.
    kept: Option<usize>,
    network: &'a FluxNetwork,
    sums: Sums,
}

/// Sums over snippets.
#[derive(Default)]
struct Sums {
    views: Vec<ViewScores>,
    pictures: Vec<Comparison>,
    baselines: Baselines,
    labels: LabelScores,
    seconds: Vec<[f64; 2]>,
    gaussians: Vec<usize>,
    moving_share: Vec<f64>,
    depth: DepthErrors,
    skipped: usize,
    scene: Option<(Gaussians, DVec3)>,
    viewed: Option<PresentedScene>,
}

/// PSNR of other Gaussians on the same views, dB.
#[derive(Default)]
struct Baselines {
    lifted: Vec<f64>,
    lifted_moving: Vec<f64>,
    still: Vec<f64>,
    still_moving: Vec<f64>,
    future: Vec<f64>,
}

/// Measures a network on the snippets of a split.
///
/// # Errors
/// When no snippet of the split can be used.
pub fn measure(network: &FluxNetwork, split: &Split, config: &FluxConfig, device: &Device) -> Result<Measurement> {
    let views = split.places.iter().map(|place| place.snippet.targets.len()).sum::<usize>();
    let kept = (split.pictures > 0).then(|| views.div_ceil(split.pictures).max(1));
    let (evaluator, clustering) = (Evaluator::new(&config.eval, device), config.own.actors.config());
    let mut measuring = Measuring { evaluator, clustering, kept, network, sums: Sums::default() };
    let mut last = "no image lies between the inputs".to_string();
    for place in split.places {
        let log = &split.logs.logs[place.log];
        // Held-out snippets are read once for each measurement and not kept.
        let inferred = prepared(split.logs, place, config).and_then(|host| {
            let inferred = infer(network, &host, log, config, device).map_err(|error| one_sentence(&error))?;
            Ok((host, inferred))
        });
        match inferred {
            Ok((host, inferred)) => measuring.add(log, &host, &inferred)?,
            Err(reason) => {
                tracing::warn!("a snippet is not measured: {reason}");
                measuring.sums.skipped += 1;
                last = reason;
            }
        }
    }
    if measuring.sums.views.is_empty() {
        bail!("no snippet of the split {} can be measured: {last}", split.name);
    }
    Ok(measuring.finish(split.name))
}

impl Measuring<'_> {
    /// Renders and compares the targets and the future of a snippet, its flow and its actors.
    fn add(&mut self, log: &DrivingLog, host: &HostSnippet, inferred: &Inferred) -> Result<()> {
        let device = inferred.raw.device();
        for view in &host.targets {
            self.target(log, host, view, inferred)?;
        }
        for view in &host.future {
            let camera = camera(log, view, &device);
            let image = color(inferred, &inferred.raw, &inferred.velocity, (&camera, view.time));
            self.sums.baselines.future.push(psnr(image, photo(view, &device)));
        }
        let scene = inferred.scene(host, REST_SPEED)?;
        let actors = find_actors(&scene, host.middle(), &[], &self.clustering)?;
        self.sums.labels.add(log, host, inferred, &scene, &actors)?;
        self.sums.moving_share.push(scene.moving() as f64 / scene.gaussians.len().max(1) as f64);
        self.sums.seconds.push([inferred.map_seconds, inferred.pass_seconds]);
        self.sums.gaussians.push(scene.gaussians.len());
        self.sums.scene.get_or_insert_with(|| in_world(&scene.at(host.middle()), &host.to_world, log.origin()));
        if self.kept.is_some() {
            self.sums.viewed.get_or_insert_with(|| {
                let presentation = snippet_page::presentation(host, log);
                PresentedScene { scene: Box::new(scene), presentation }
            });
        }
        Ok(())
    }

    /// Compares one image between the inputs.
    fn target(&mut self, log: &DrivingLog, host: &HostSnippet, view: &HostView, inferred: &Inferred) -> Result<()> {
        let device = inferred.raw.device();
        let (camera, truth, rest) = (camera(log, view, &device), photo(view, &device), inferred.sample.at_rest());
        let frame = &inferred.sample.frame;
        let rendering = frame.render(inferred.raw.clone(), inferred.velocity.clone(), (&camera, view.time), false);
        let ours = rendering.color.clone().clamp(0.0, 1.0);
        let lifted = color(inferred, &inferred.sample.lifted.raw, &rest, (&camera, view.time));
        let still = color(inferred, &inferred.raw, &rest, (&camera, view.time));
        let Some(whole) = self.evaluator.scores(ours.clone(), truth.clone(), None) else { return Ok(()) };
        self.sums.baselines.lifted.push(psnr(lifted.clone(), truth.clone()));
        self.sums.baselines.still.push(psnr(still.clone(), truth.clone()));
        let mut regions = BTreeMap::new();
        let mask = moving::mask(log, host, view)?;
        self.sums.depth.add(&rendering, view, mask.as_deref());
        if let Some(mask) = mask {
            let mask = image_tensor(&mask, [view.image.height, view.image.width, 1], &device);
            self.sums.baselines.lifted_moving.push(psnr_masked(lifted.clone(), truth.clone(), mask.clone()));
            self.sums.baselines.still_moving.push(psnr_masked(still, truth.clone(), mask.clone()));
            let scores = scores_within(ours.clone(), truth.clone(), mask);
            regions.extend(scores.map(|scores| (MOVING.to_string(), scores)));
        }
        if self.kept.is_some_and(|every| self.sums.views.len().is_multiple_of(every)) {
            let velocity = velocity_picture(inferred, (&camera, view.time));
            let more = vec![("lifted points alone", lifted), ("velocity", velocity)];
            let (name, psnr) = (view.name.clone(), whole.psnr);
            self.sums.pictures.push(Comparison { name, truth, image: ours, mask: None, blurry: None, psnr, more });
        }
        self.sums.views.push(ViewScores { name: view.name.clone(), scores: whole, regions });
        Ok(())
    }

    fn finish(self, name: &str) -> Measurement {
        let quality = self.evaluator.summary(self.sums.views.clone(), "photo");
        let mut figures = self.sums.baselines.figures(quality.mean.psnr, quality.moving().map(|scores| scores.psnr));
        figures.extend(self.sums.depth.figures());
        figures.extend(self.sums.labels.figures());
        figures.extend(self.cost_figures());
        let gaussians = self.sums.gaussians.iter().max().copied().unwrap_or(0);
        // Position, quaternion, scale, opacity, colour: 14 numbers.
        let size = ModelSize { gaussians, bytes: 4 * 14 * gaussians };
        let tables = self.sums.labels.table().into_iter().collect();
        let measured = Measured { split: name.into(), quality, size, figures, tables };
        Measurement { measured, pictures: self.sums.pictures, scene: self.sums.scene, viewed: self.sums.viewed }
    }

    fn cost_figures(&self) -> Vec<Figure> {
        let seconds = |index: usize| mean(self.sums.seconds.iter().map(|pair| pair[index]));
        let mut figures = Vec::new();
        let timed =
            |key: &str, name: &str, value: f64| Figure::new(key, name, value, "s").digits(3).better(Better::Lower);
        figures.extend(seconds(0).map(|value| timed("seconds_maps", "kernel maps of a snippet", value)));
        figures.extend(seconds(1).map(|value| timed("seconds_passes", "passes of a snippet", value).column()));
        let share = mean(&self.sums.moving_share).unwrap_or(0.0);
        figures.push(Figure::new("moving_share", "share of Gaussians that move", share, "").digits(3));
        let parameters = super::saved::parameters(self.network);
        figures.push(Figure::new("parameters", "parameters of the network", parameters as f64, ""));
        figures.push(Figure::new("snippets", "snippets measured", self.sums.seconds.len() as f64, ""));
        figures.push(Figure::new("snippets_skipped", "snippets that could not be used", self.sums.skipped as f64, ""));
        figures
    }
}

/// Squared errors of rendered depth over the pixels with LiDAR between the inputs that the Gaussians cover, square
/// metres.
#[derive(Default)]
struct DepthErrors {
    all: Mean,
    moving: Mean,
}

impl DepthErrors {
    /// Adds a view; `mask` is 255 where it moves.
    fn add(&mut self, rendering: &Rendering, view: &HostView, mask: Option<&[u8]>) {
        let Some(depth) = rendering.expected_depth().map(to_host) else { return };
        let alpha = to_host(rendering.alpha.clone());
        let seen = |pixel: &usize| view.depth[*pixel] > 0.0 && f64::from(alpha[*pixel]) > COVERED;
        for pixel in (0..view.depth.len()).filter(seen) {
            let squared = f64::from(depth[pixel] - view.depth[pixel]).powi(2);
            self.all.add(squared);
            if mask.is_some_and(|mask| mask[pixel] == 255) {
                self.moving.add(squared);
            }
        }
    }

    fn figures(&self) -> Vec<Figure> {
        let root = |key: &str, name: &str, squared: Mean| {
            squared.value().map(|mean| Figure::new(key, name, mean.sqrt(), "m").digits(2).better(Better::Lower))
        };
        let all = root("depth_rmse", "depth RMSE", self.all);
        all.into_iter().chain(root("depth_rmse_moving", "depth RMSE, moving parts", self.moving)).collect()
    }
}

impl Baselines {
    /// The figures beside the PSNR of the network, over whole images and over moving parts.
    fn figures(&self, ours: f64, ours_moving: Option<f64>) -> Vec<Figure> {
        let decibel = |key: &str, name: &str, value: f64| Figure::new(key, name, value, "dB").digits(2);
        let mut figures = Vec::new();
        if let Some(lifted) = mean(&self.lifted) {
            figures.push(decibel("psnr_lifted", "lifted points alone, PSNR", lifted).column());
            let gain = decibel("gain", "gain over the lifted points", ours - lifted);
            figures.push(gain.better(Better::Higher).headline());
        }
        let lifted_moving = mean(&self.lifted_moving);
        figures.extend(lifted_moving.map(|psnr| decibel("psnr_lifted_moving", "lifted points, moving parts", psnr)));
        figures.extend(mean(&self.still).map(|psnr| decibel("psnr_still", "without velocities, PSNR", psnr)));
        if let Some((still, ours)) = mean(&self.still_moving).zip(ours_moving) {
            figures.push(decibel("psnr_still_moving", "without velocities, moving parts", still));
            let gain = decibel("gain_moving", "gain of the velocities in moving parts", ours - still);
            figures.push(gain.better(Better::Higher).headline());
        }
        let future = mean(&self.future).map(|psnr| decibel("psnr_future", "frames after the inputs, PSNR", psnr));
        figures.extend(future.map(|figure| figure.better(Better::Higher).column()));
        figures
    }
}

/// The image of Gaussians with velocities, `[H, W, 3]`, 0 to 1.
pub fn color(inferred: &Inferred, raw: &Tensor<2>, velocity: &Tensor<2>, view: (&Camera, f64)) -> Tensor<3> {
    inferred.sample.frame.render(raw.clone(), velocity.clone(), view, false).color.clamp(0.0, 1.0)
}

/// The motion in the image in colour, `[H, W, 3]`: grey is at rest, red and green are right and down.
pub fn velocity_picture(inferred: &Inferred, view: (&Camera, f64)) -> Tensor<3> {
    let rendering = inferred.sample.frame.render(inferred.raw.clone(), inferred.velocity.clone(), view, true);
    let [height, width, _] = rendering.color.dims();
    let pixels = rendering.features.map(to_host).unwrap_or_default();
    let vectors: Vec<f32> = pixels.as_chunks::<2>().0.iter().flat_map(|[u, v]| [*u, *v, 0.0]).collect();
    image_tensor(&velocity_colors(&vectors), [height, width, 3], &rendering.color.device())
}
