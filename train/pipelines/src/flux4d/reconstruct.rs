//! `gsburn reconstruct`: a log, a network, and out come images at any time, actors and Gaussians.

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result, anyhow, bail};
use burn::tensor::Tensor;
use gs_base::{counted, guarded, write_atomic};
use gs_burn::{Gaussians, RenderOptions, render};
use gs_driving::{DrivingLog, Snippet, runs};
use gs_models::DynamicScene;
use gs_models::flux4d::FluxScene;
use gs_models::flux4d::actors::{Actor, EditScript, apply_edits, clustered, described};
use gs_models::flux4d::scene::REST_SPEED;

use super::actors_file::ActorList;
use super::degrees::{Degrees, choose_degrees};
use super::host_view::HostView;
use super::infer::infer;
use super::label_scores::LabelScores;
use super::logs::{MIN_FRAMES, open, snippets, times, warn};
use super::memory::of_reconstruction;
use super::polish::{Polished, polish};
use super::prepare::{HostSnippet, prepare};
use super::sample::{camera, photo};
use super::saved::{SavedNetwork, parameters};
use super::snippet_page;
use super::summary::{Seconds, Summary, of_all};
use super::world::in_world;
use crate::Reconstruction;
use gs_train::run::interrupt;
use gs_train::run::metrics::{mean, psnr};
use gs_train::run::outputs::{MARK, write_json, write_png};
use gs_train::run::pixels::image_bytes;
use gs_train::run::progress;
use gs_train::run::results::Results;
use gs_train::run::scene::{outside, write_ply};

/// The file with all figures, by which a folder of an earlier reconstruction is known.
const SUMMARY: &str = "reconstruction.json";
/// Largest edit script, bytes: an edit takes some 100.
const SCRIPT_MAX: u64 = 1 << 20;
/// Input frames reach over this many frames of a snippet.
const PAST: usize = gs_driving::INTERPOLATION_FRAMES;

/// A reconstruction under way.
struct Reconstructor<'a> {
    request: &'a Reconstruction<'a>,
    saved: &'a SavedNetwork,
    /// The folder of the files until all are there.
    folder: PathBuf,
    log: DrivingLog,
    script: Option<EditScript>,
    done: Done,
}

/// Sums over the snippets that are done.
#[derive(Default)]
struct Done {
    seconds: Seconds,
    labels: LabelScores,
    psnr: Vec<f64>,
    polished: Vec<Polished>,
    degrees: Degrees,
    /// First time of the first snippet, seconds.
    begin: Option<f64>,
    images: usize,
    sizes: [usize; 2],
    actors: ActorList,
}

/// Reconstructs a snippet or a whole log and writes images, actors, Gaussians and figures. Returns lines for the
/// terminal. Ctrl-C ends it after the snippet at hand, and what is done is kept.
///
/// # Errors
/// One sentence: a bad log, edit script or folder.
pub fn reconstruct(saved: &SavedNetwork, request: &Reconstruction) -> Result<Vec<String>> {
    let script = request.edit.map(read_script).transpose()?;
    if script.is_some() && request.full {
        bail!("--edit: expected one snippet, since actors are numbered in each; leave out --full");
    }
    let log = open(request.log, &saved.config.own.logs)?;
    let list = chosen(&log, saved, request)?;
    warn(&log);
    let memory = of_reconstruction(&saved.config, &log, parameters(&saved.network), &list);
    progress::say(&format!("{}: {}; memory expected: {memory}", log.name(), counted(list.len(), "snippet")), false);
    let results = Results::begin(request.out, SUMMARY)?;
    let mut reconstructor =
        Reconstructor { request, saved, folder: results.folder(), log, script, done: Done::default() };
    let mut done = 0;
    while done < list.len() && !interrupt::asked() {
        reconstructor.snippet(&list, done)?;
        done += 1;
    }
    if done == 0 {
        bail!("interrupted before the first snippet");
    }
    let summary = reconstructor.finish([done, list.len()])?;
    results.finish()?;
    Ok(summary.lines(request.out))
}

fn read_script(path: &Path) -> Result<EditScript> {
    let text = guarded::read_to_string(path, SCRIPT_MAX)?;
    let one_line = |error: toml::de::Error| gs_train::config::tables::one_line(&error);
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
        config.every = config.spacing().min(PAST - 1);
        return Ok(snippets(&times(log), &config));
    }
    let run = runs(&times(log)).into_iter().find(|run| run.contains(&request.start));
    let left = run.map_or(0, |run| run.end - request.start);
    if left < MIN_FRAMES {
        let path = log.path().display();
        bail!(
            "{path}: expected {MIN_FRAMES} frames or more without a gap from --start {} on, found {left} of {frames}",
            request.start
        );
    }
    Ok(vec![Snippet::new(request.start, config.frames.min(left))])
}

impl Reconstructor<'_> {
    /// Snippet `number` of `all`.
    fn snippet(&mut self, all: &[Snippet], number: usize) -> Result<()> {
        let (begun, snippet) = (Instant::now(), &all[number]);
        let name = format!("{}-{:03}", self.log.name(), snippet.frames[0]);
        let config = &self.saved.config;
        let host = prepare(&self.log, snippet, &name, &config.own.lift, config.seed)?;
        self.done.seconds.read_and_lift += begun.elapsed().as_secs_f64();
        let mut inferred = infer(&self.saved.network, &host, &self.log, config, self.request.device)?;
        self.done.seconds.maps += inferred.map_seconds;
        self.done.seconds.passes += inferred.pass_seconds;
        let polished = polish(&mut inferred, &host, &self.log, config, self.request.polish, self.request.device);
        self.done.seconds.polish += polished.map_or(0.0, |polished| polished.seconds);
        self.done.polished.extend(polished);
        let rest = self.request.rest_speed.unwrap_or(REST_SPEED);
        let mut scene = inferred.scene(&host, rest)?;
        let begun = Instant::now();
        let actors = self.actors_of(&mut scene, &host)?;
        inferred.follow(&scene);
        self.done.seconds.actors += begun.elapsed().as_secs_f64();
        self.done.labels.add(&self.log, &host, &inferred, &scene, &actors)?;
        let (edited, rows) = match &self.script {
            Some(script) => {
                let edited = apply_edits(&scene, &actors, script)?;
                (edited.scene, edited.actors)
            }
            None => (scene, actors.iter().map(|actor| actor.rows.clone()).collect()),
        };
        self.done.sizes[0] = self.done.sizes[0].max(edited.gaussians.len());
        self.done.sizes[1] = self.done.sizes[1].max(edited.moving());
        self.images(&edited, &host, |frame| owner(all, frame) == number)?;
        self.novel_times(&edited, &host, all, number)?;
        let ply = self.folder.join(format!("{name}.ply"));
        self.plys(&edited, &host, &ply, &rows)?;
        let page = (self.request.page)(&edited, &snippet_page::presentation(&host, &self.log));
        write_atomic(&ply.with_extension("html"), page.as_bytes())?;
        let world = glam::DMat4::from_translation(self.log.origin()) * host.to_world;
        self.done.actors.add(&name, actors, &world, self.log.frames()[0].time);
        Ok(())
    }

    /// The Gaussians in the middle of the window: all of them, and those of each actor.
    fn plys(&self, scene: &FluxScene, host: &HostSnippet, whole: &Path, actors: &[Vec<u32>]) -> Result<()> {
        let write = |path: &Path, gaussians: &Gaussians| {
            let (gaussians, origin) = in_world(gaussians, &host.to_world, self.log.origin());
            write_ply(path, &gaussians, origin)
        };
        write(whole, &scene.at(host.middle()))?;
        // An edit may have removed an actor.
        for (number, rows) in actors.iter().enumerate().filter(|(_, rows)| !rows.is_empty()) {
            let path = self.folder.join("actors").join(format!("{}-{number:02}.ply", host.name));
            write(&path, &scene.moving_at(host.middle(), rows))?;
        }
        Ok(())
    }

    /// The actors, each with a velocity of the lowest degree that held-out sweeps bear out.
    fn actors_of(&mut self, scene: &mut FluxScene, host: &HostSnippet) -> Result<Vec<Actor>> {
        let [begin, end] = host.window;
        let times: Vec<f64> = (0..=10).map(|i| begin + 0.1 * f64::from(i) * (end - begin)).collect();
        let rows = clustered(scene, host.middle(), &self.saved.config.own.actors.config())?;
        let (degrees, told) = choose_degrees(scene, &rows, &self.log, host)?;
        self.done.degrees.add(&told);
        let mut actors = described(scene, rows, host.middle(), &times);
        actors.iter_mut().zip(degrees).for_each(|(actor, degree)| actor.degree = degree);
        Ok(actors)
    }

    /// The images of the frames that this snippet shows.
    fn images(&mut self, scene: &FluxScene, host: &HostSnippet, is_own: impl Fn(usize) -> bool) -> Result<()> {
        let is_plain = self.script.is_none() && self.request.shift == [0.0; 3];
        let kinds = [("input", &host.inputs), ("target", &host.targets), ("future", &host.future)];
        for (kind, views) in kinds {
            for view in views.iter().filter(|view| is_own(view.frame)) {
                let image = self.render(scene, view, view.seconds)?;
                if kind == "target" && is_plain {
                    self.done.psnr.push(psnr(image.clone(), photo(view, self.request.device)));
                }
                let path = self.folder.join(kind).join(format!("{}.png", view.name));
                self.write(&path, view, &image_bytes(image))?;
            }
        }
        Ok(())
    }

    /// The times asked for that snippet `number` of `all` shows, between and beyond the frames, from the camera of the
    /// nearest input.
    fn novel_times(&mut self, scene: &FluxScene, host: &HostSnippet, all: &[Snippet], number: usize) -> Result<()> {
        let frames = times(&self.log);
        if self.done.begin.is_none() {
            self.warn_outside(host.window[0], &frames, all);
        }
        let begin = *self.done.begin.get_or_insert(host.window[0]);
        for time in self.request.times {
            let seconds = begin + time;
            if owner_of_time(all, &frames, seconds) != number {
                continue;
            }
            let gap = |view: &&HostView| (view.seconds - seconds).abs();
            let nearest = host.inputs.iter().min_by(|a, b| gap(a).total_cmp(&gap(b)));
            let view = nearest.context("a snippet has an input image")?;
            let image = self.render(scene, view, seconds)?;
            let path = self.folder.join("times").join(format!("{time:+08.3}-s.png"));
            self.write(&path, view, &image_bytes(image))?;
        }
        Ok(())
    }

    /// Warns of times outside of what the snippets show: a path is an expansion, and diverges outside the window it was
    /// fitted in.
    fn warn_outside(&self, begin: f64, frames: &[f64], all: &[Snippet]) {
        let last = all.iter().filter_map(|snippet| snippet.frames.last()).max().map_or(begin, |frame| frames[*frame]);
        // Clocks have microseconds at most, and a difference of f64 more digits than that.
        let seconds = (1e3 * (last - begin)).round() / 1e3;
        if let Some(warning) = outside(self.request.times, [0.0, seconds]) {
            tracing::warn!("--times: {warning}");
        }
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
        self.done.seconds.render += begun.elapsed().as_secs_f64();
        Ok(image)
    }

    fn write(&mut self, path: &Path, view: &HostView, pixels: &[u8]) -> Result<()> {
        write_png(path, [view.image.width, view.image.height], pixels)?;
        self.done.images += 1;
        Ok(())
    }

    /// Writes actors and figures; `snippets` are those done and those asked for.
    fn finish(self, [snippets, snippets_asked]: [usize; 2]) -> Result<Summary> {
        self.done.actors.write(&self.folder.join("actors.json"))?;
        let psnr_targets = mean(&self.done.psnr);
        let summary = Summary {
            program: MARK,
            log: self.log.name().to_string(),
            snippets,
            snippets_asked,
            gaussians: self.done.sizes[0],
            moving_gaussians: self.done.sizes[1],
            actors: self.done.actors.count(),
            images: self.done.images,
            psnr_targets,
            seconds: self.done.seconds,
            polish: of_all(&self.done.polished),
            degrees: self.done.degrees,
            flow: self.done.labels.figures(),
            tables: self.done.labels.table().into_iter().collect(),
        };
        write_json(&self.folder.join(SUMMARY), &summary)?;
        Ok(summary)
    }
}

/// The snippet that shows a frame: the one whose middle is nearest.
fn owner(all: &[Snippet], frame: usize) -> usize {
    let off = |snippet: &Snippet| (2 * frame).abs_diff(snippet.frames[0] + snippet.frames[snippet.frames.len() - 1]);
    let holding = all.iter().enumerate().filter(|(_, snippet)| snippet.frames.contains(&frame));
    holding.min_by_key(|(number, snippet)| (off(snippet), *number)).map_or(0, |(number, _)| number)
}

/// The snippet that shows a time (seconds): of those whose inputs reach over it, or come nearest to it, the one whose
/// middle is nearest. `times` are those of all frames.
fn owner_of_time(all: &[Snippet], times: &[f64], seconds: f64) -> usize {
    let off = |snippet: &Snippet| {
        let (first, last) = (times[snippet.inputs[0]], times[snippet.inputs[snippet.inputs.len() - 1]]);
        let outside = (first - seconds).max(seconds - last).max(0.0);
        (outside, (0.5 * (first + last) - seconds).abs())
    };
    let order = |a: &(f64, f64), b: &(f64, f64)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1));
    (0..all.len()).min_by(|a, b| order(&off(&all[*a]), &off(&all[*b]))).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_is_shown_by_the_snippet_that_holds_it() {
        let times: Vec<f64> = (0..30).map(|frame| 5.0 + 0.1 * f64::from(frame)).collect();
        let all = [Snippet::new(0, 11), Snippet::new(6, 11), Snippet::new(19, 5)];
        let owner = |seconds: f64| owner_of_time(&all, &times, 5.0 + seconds);
        assert_eq!([-1.0, 0.3, 0.75, 0.85, 1.5, 1.9, 2.2, 9.0].map(owner), [0, 0, 0, 1, 1, 2, 2, 2]);
        // Between the second and the third it is the nearer one.
        assert_eq!([1.7, 1.8].map(owner), [1, 2]);
    }
}
