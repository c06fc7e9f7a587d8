//! `gsburn reconstruct`: a log, a network, and out come images at any time, actors and Gaussians.

use std::fs;
use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result, anyhow, bail};
use burn::tensor::Tensor;
use gs_burn::{RenderOptions, render};
use gs_datasets::image_io::{encode_png, write_atomic};
use gs_datasets::{counted, guarded};
use gs_driving::{DrivingLog, Snippet};
use gs_models::DynamicScene;
use gs_models::flux4d::FluxScene;
use gs_models::flux4d::actors::{Actor, EditScript, apply_edits, find_actors};
use gs_models::flux4d::scene::REST_SPEED;
use serde::Serialize;

use super::actor_recall::ActorScores;
use super::actors_file::ActorList;
use super::flow::{self, FlowScores};
use super::infer::{Ready, infer};
use super::logs::{open, snippets};
use super::prepare::{HostSnippet, HostView, prepare};
use super::sample::{camera, photo};
use super::saved::SavedNetwork;
use super::snippet_page;
use super::world::in_world;
use crate::fit::figure::Figure;
use crate::pipelines::Reconstruction;
use crate::report::pictures::image_bytes;
use crate::report::viewer;
use crate::run::metrics::psnr;
use crate::run::outputs::{MARK, check_one, marked_png};
use crate::run::scene::write_ply;

/// The file with all figures, by which a folder of an earlier reconstruction is known.
const SUMMARY: &str = "reconstruction.json";
/// Largest edit script, bytes: an edit takes some 100.
const SCRIPT_MAX: u64 = 1 << 20;
/// Input frames reach over this many frames of a snippet.
const PAST: usize = gs_driving::INTERPOLATION_FRAMES;

/// Seconds of each stage, and how long it is per frame.
#[derive(Debug, Clone, Copy, Default, Serialize)]
struct Seconds {
    /// Reading sweeps and images, colouring, thinning, lifting.
    read_and_lift: f64,
    /// Sending the snippet and building its kernel maps.
    maps: f64,
    /// All passes of the networks, with the renderings that are fed back.
    passes: f64,
    /// Rendering the images that are written.
    render: f64,
}

/// What is written beside the images.
#[derive(Debug, Serialize)]
struct Summary {
    program: &'static str,
    log: String,
    snippets: usize,
    gaussians: usize,
    moving_gaussians: usize,
    actors: usize,
    images: usize,
    /// Mean PSNR of the frames between the inputs, dB; none with edits or a moved sensor.
    psnr_targets: Option<f64>,
    seconds: Seconds,
    flow: Vec<Figure>,
}

/// A reconstruction under way.
struct Work<'a> {
    request: &'a Reconstruction<'a>,
    saved: &'a SavedNetwork,
    ready: Ready,
    log: DrivingLog,
    script: Option<EditScript>,
    seconds: Seconds,
    flow: FlowScores,
    recall: ActorScores,
    psnr: Vec<f64>,
    images: usize,
    sizes: [usize; 2],
    actors: ActorList,
}

/// Reconstructs a snippet or a whole log and writes images, actors, Gaussians and figures. Returns lines for the
/// terminal.
///
/// # Errors
/// One sentence: a bad log, edit script or folder.
pub fn reconstruct(saved: &SavedNetwork, request: &Reconstruction) -> Result<Vec<String>> {
    vacant(request.out)?;
    let script = request.edit.map(read_script).transpose()?;
    if script.is_some() && request.full {
        bail!("--edit: expected one snippet, since actors are numbered in each; leave out --full");
    }
    let log = open(request.log, &saved.config.own.logs)?;
    let list = chosen(&log, saved, request)?;
    let ready = Ready::new(&saved.network);
    let mut work = Work {
        request,
        saved,
        ready,
        log,
        script,
        seconds: Seconds::default(),
        flow: FlowScores::default(),
        recall: ActorScores::default(),
        psnr: Vec::new(),
        images: 0,
        sizes: [0; 2],
        actors: ActorList::default(),
    };
    for (number, snippet) in list.iter().enumerate() {
        work.snippet(snippet, &list, number)?;
    }
    work.finish(list.len())
}

/// That nothing of the user is written over.
fn vacant(out: &Path) -> Result<()> {
    if out.is_file() {
        bail!("{}: expected a folder or nothing, found a file", out.display());
    }
    let is_empty = fs::read_dir(out).map_or(true, |mut entries| entries.next().is_none());
    let summary = out.join(SUMMARY);
    if !is_empty && (!summary.is_file() || check_one(&summary).is_err()) {
        bail!("{}: expected an empty folder, none, or an earlier reconstruction; choose another --out", out.display());
    }
    Ok(())
}

fn read_script(path: &Path) -> Result<EditScript> {
    let text = guarded::read_to_string(path, SCRIPT_MAX)?;
    let one_line = |error: toml::de::Error| crate::config::tables::one_line(&error);
    toml::from_str(&text).map_err(|error| anyhow!("{}: expected an edit script: {}", path.display(), one_line(error)))
}

/// The snippets: one from the first frame asked for, or all.
fn chosen(log: &DrivingLog, saved: &SavedNetwork, request: &Reconstruction) -> Result<Vec<Snippet>> {
    let mut config = saved.config.own.logs.clone();
    if request.future > 0 {
        config.frames = PAST + request.future;
    }
    let frames = log.frames().len();
    if request.full {
        // Only what lies between inputs is shown of a whole log.
        config.frames = config.frames.min(PAST);
        config.every = config.every.min(PAST - 1);
        return Ok(snippets(frames, &config));
    }
    let left = frames.saturating_sub(request.start);
    if left < 3 {
        let path = log.path().display();
        bail!("{path}: expected 3 frames or more from --start {} on, found {left} of {frames}", request.start);
    }
    Ok(vec![Snippet::new(request.start, config.frames.min(left))])
}

impl Work<'_> {
    fn snippet(&mut self, snippet: &Snippet, all: &[Snippet], number: usize) -> Result<()> {
        let begun = Instant::now();
        let name = format!("{}-{:03}", self.log.name(), snippet.frames[0]);
        let config = &self.saved.config;
        let host = prepare(&self.log, snippet, &name, &config.own.lift, config.seed)?;
        self.seconds.read_and_lift += begun.elapsed().as_secs_f64();
        let inferred = infer(&self.ready, &host, &self.log, config, self.request.device)?;
        self.seconds.maps += inferred.map_seconds;
        self.seconds.passes += inferred.pass_seconds;
        let rest = self.request.rest_speed.unwrap_or(REST_SPEED);
        let scene = inferred.scene(&host, rest)?;
        let sweeps = flow::of_inputs(&self.log, &host, &inferred, &snippet.inputs)?;
        for sweep in &sweeps {
            self.flow.add(sweep)?;
        }
        let actors = self.actors_of(&scene, &host)?;
        self.recall.add(&scene, &actors, &sweeps);
        let edited = match &self.script {
            Some(script) => apply_edits(&scene, &actors, script)?.scene,
            None => scene,
        };
        self.sizes[0] = self.sizes[0].max(edited.gaussians.len());
        self.sizes[1] = self.sizes[1].max(edited.moving());
        self.images(&edited, &host, |frame| owner(all, frame) == number)?;
        if number == 0 {
            self.novel_times(&edited, &host)?;
        }
        let middle = 0.5 * (host.window[0] + host.window[1]);
        let ply = self.request.out.join(format!("{name}.ply"));
        let (gaussians, origin) = in_world(&edited.at(middle), &host.to_world, self.log.origin());
        write_ply(&ply, &gaussians, origin)?;
        let page = viewer::page(&name, &snippet_page::packed(&edited, &host, &self.log));
        write_atomic(&ply.with_extension("html"), page.as_bytes())?;
        let world = glam::DMat4::from_translation(self.log.origin()) * host.to_world;
        self.actors.add(&name, actors, &world, self.log.frames()[0].time);
        Ok(())
    }

    fn actors_of(&self, scene: &FluxScene, host: &HostSnippet) -> Result<Vec<Actor>> {
        let [begin, end] = host.window;
        let times: Vec<f64> = (0..=10).map(|i| begin + 0.1 * f64::from(i) * (end - begin)).collect();
        let clustering = self.saved.config.own.actors.config();
        Ok(find_actors(scene, 0.5 * (begin + end), &times, &clustering)?)
    }

    /// The images of the frames that this snippet shows.
    fn images(&mut self, scene: &FluxScene, host: &HostSnippet, is_own: impl Fn(usize) -> bool) -> Result<()> {
        let is_plain = self.script.is_none() && self.request.shift == [0.0; 3];
        let kinds = [("input", &host.inputs), ("target", &host.targets), ("future", &host.future)];
        for (kind, views) in kinds {
            for view in views.iter().filter(|view| is_own(view.frame)) {
                let image = self.render(scene, view, view.seconds)?;
                if kind == "target" && is_plain {
                    self.psnr.push(psnr(image.clone(), photo(view, self.request.device)));
                }
                let path = self.request.out.join(kind).join(format!("{}.png", view.name));
                self.write(&path, view, &image_bytes(image))?;
            }
        }
        Ok(())
    }

    /// Times between and beyond the frames, from the camera of the nearest input.
    fn novel_times(&mut self, scene: &FluxScene, host: &HostSnippet) -> Result<()> {
        for time in self.request.times {
            let seconds = host.window[0] + time;
            let gap = |view: &&HostView| (view.seconds - seconds).abs();
            let nearest = host.inputs.iter().min_by(|a, b| gap(a).total_cmp(&gap(b)));
            let view = nearest.context("a snippet has an input image")?;
            let image = self.render(scene, view, seconds)?;
            let path = self.request.out.join("times").join(format!("{time:+08.3}-s.png"));
            self.write(&path, view, &image_bytes(image))?;
        }
        Ok(())
    }

    fn render(&mut self, scene: &FluxScene, view: &HostView, seconds: f64) -> Result<Tensor<3>> {
        let begun = Instant::now();
        let mut moved = view.clone();
        let [forward, left, up] = self.request.shift;
        // Along the axes of the camera (x right, y down, z forward).
        moved.c2w *= glam::DMat4::from_translation(glam::DVec3::new(-left, -up, forward));
        let camera = camera(&self.log, &moved, self.request.device);
        let options = RenderOptions { sh_degree: 0, ..RenderOptions::default() };
        let image = render(&scene.at(seconds), &camera, &options).color.clamp(0.0, 1.0);
        self.seconds.render += begun.elapsed().as_secs_f64();
        Ok(image)
    }

    fn write(&mut self, path: &Path, view: &HostView, pixels: &[u8]) -> Result<()> {
        let png = encode_png(path, view.image.width, view.image.height, pixels)?;
        write_atomic(path, &marked_png(&png))?;
        self.images += 1;
        Ok(())
    }

    fn finish(self, snippets: usize) -> Result<Vec<String>> {
        let out = self.request.out;
        self.actors.write(&out.join("actors.json"))?;
        let psnr_targets = (!self.psnr.is_empty()).then(|| self.psnr.iter().sum::<f64>() / self.psnr.len() as f64);
        let summary = Summary {
            program: MARK,
            log: self.log.name().to_string(),
            snippets,
            gaussians: self.sizes[0],
            moving_gaussians: self.sizes[1],
            actors: self.actors.count(),
            images: self.images,
            psnr_targets,
            seconds: self.seconds,
            flow: [self.flow.figures(), self.recall.figures()].concat(),
        };
        let text = serde_json::to_string_pretty(&summary).expect("figures are JSON") + "\n";
        write_atomic(&out.join(SUMMARY), text.as_bytes())?;
        Ok(lines(&summary, out))
    }
}

/// The snippet that shows a frame: the one whose middle is nearest.
fn owner(all: &[Snippet], frame: usize) -> usize {
    let off = |snippet: &Snippet| (2 * frame).abs_diff(snippet.frames[0] + snippet.frames[snippet.frames.len() - 1]);
    let holding = all.iter().enumerate().filter(|(_, snippet)| snippet.frames.contains(&frame));
    holding.min_by_key(|(number, snippet)| (off(snippet), *number)).map_or(0, |(number, _)| number)
}

fn lines(summary: &Summary, out: &Path) -> Vec<String> {
    let Seconds { read_and_lift, maps, passes, render } = summary.seconds;
    let mut lines = vec![
        format!(
            "{}: {}, {} of at most {} Gaussians ({} of them move), {}",
            summary.log,
            counted(summary.snippets, "snippet"),
            counted(summary.images, "image"),
            summary.gaussians,
            summary.moving_gaussians,
            counted(summary.actors, "actor")
        ),
        format!("seconds: read and lift {read_and_lift:.2}, maps {maps:.2}, passes {passes:.2}, render {render:.2}"),
    ];
    lines.extend(summary.psnr_targets.map(|psnr| format!("frames between the inputs: PSNR {psnr:.2} dB")));
    let figures: Vec<String> =
        summary.flow.iter().map(|figure| format!("{} {}", figure.name, figure.shown())).collect();
    if !figures.is_empty() {
        lines.push(format!("scene flow: {}", figures.join("; ")));
    }
    lines.push(format!("written to {}", out.display()));
    lines
}
