//! `gsburn extrapolate`: what comes after a recording.
//!
//! | file | idea |
//! |---|---|
//! | [`plan`] | times, cameras and files, checked before anything is drawn |
//! | [`frames`] | frames, animation and PLY files |
//! | [`parts`] | rigid parts and their laws |
//! | [`ensemble`] | the ensemble, and whether its spread is right |
//! | [`figures`] | extrapolate.json |

pub mod ensemble;
pub mod figures;
pub mod frames;
pub mod parts;
pub mod plan;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use glam::DVec3;
use gs_base::{counted, printable, write_atomic};
use gs_datasets::Split;

use crate::cli::ExtrapolateArgs;
use crate::commands::{device, print};
use crate::report::future::spread::moving_rows;
use crate::report::future::{PredictedScene, SceneRenderer, Shown, add_to_report, motion, section, trajectories};
use gs_pipelines::{Opened, of_checkpoint};
use gs_train::fit::extrapolation::Extrapolation;
use gs_train::fit::parameters::to_host;
use gs_train::run::folder::RunFolder;
use gs_train::run::outputs::{self, marked_svg, write_json};
use gs_train::run::results::Results;
use gs_train::run::scene::{LoadedScene, SceneFile, read_file};
use gs_train::sentence::one_sentence;

use figures::Figures;
use plan::{Files, Shot};

/// Pixels by which a Gaussian moves at least from the first time to the last to count as moving.
const MOVES: f64 = 0.5;

/// Seed of the choice of paths that are drawn.
const SEED: u64 = 0;

/// Everything that the parts of the command share.
struct Work<'a> {
    args: &'a ExtrapolateArgs,
    /// The files while they are made.
    files: Files,
    /// The same where they will be.
    placed: Files,
    predicted: PredictedScene<'a>,
    loaded: &'a LoadedScene,
    /// First and last time that was seen.
    span: [f64; 2],
    times: Vec<f64>,
    shots: Vec<Shot>,
    /// The Gaussians that move.
    moving: Vec<u32>,
    /// Scene units of a pixel of the first camera, where things move.
    pixel: f64,
}

/// Predicts, draws and measures the future of a run.
///
/// # Errors
/// One sentence saying what was wrong with the run, the data set, the times or the disk.
pub fn run(args: &ExtrapolateArgs) -> Result<ExitCode> {
    let device = device(&args.device)?;
    let out = plan::folder(args)?;
    let SceneFile::Checkpoint(checkpoint) = read_file(&args.run)? else {
        bail!("{}: expected a run with a moving scene, found a PLY file, which is one moment", args.run.display());
    };
    let dataset = args.data.clone().unwrap_or_else(|| checkpoint.origin.dataset.clone());
    let pipeline = of_checkpoint(&checkpoint)?;
    let Opened { loaded, photos } = pipeline.open(&checkpoint, Some(&dataset), &device)?;
    let photos = photos.context("a data set was named")?;
    let Some(span) = loaded.scene.span() else {
        bail!("{}: expected a run with a moving scene, found one that stands still", args.run.display());
    };
    let trained = pipeline.future().map(|extrapolate| extrapolate(&checkpoint, &photos, &device)).transpose()?;
    let renderer = SceneRenderer { facts: loaded.facts, render: loaded.render.clone(), device };
    let stepped = frames::stepped(args, trained.as_deref())?;
    let future = stepped.as_deref().or(trained.as_deref());
    let scene = future.map(|future| future.scene());
    let scene = scene.as_deref().unwrap_or(&*loaded.scene);
    let last = future.map_or(f64::INFINITY, |future| future.last());
    let times = plan::times(args, span, plan::interval(&photos), last)?;
    let predicted = PredictedScene { renderer: &renderer, scene, photos: &photos, measured: None };

    let middle = middle(&predicted, span, args.to);
    let shots = plan::shots(&args.camera, &photos, middle, times.len())?;
    let camera = shots[0].pose(0);
    let depth = camera.c2w.inverse().transform_point3(middle).z;
    let pixel = if depth > 0.0 { depth / camera.intrinsics.fx } else { 1.0 };
    let moving = moving_rows(scene, &[span[0], span[1], 0.5 * (span[1] + args.to), args.to], MOVES * pixel);
    let (files, placed) = (Files::new(Results::unfinished(&out)), Files::new(out.clone()));
    let work = Work { args, files, placed, predicted, loaded: &loaded, span, times, shots, moving, pixel };
    work.check(&dataset)?;
    let results = Results::begin(&out, figures::JSON)?;
    let section = work.all(future, &dataset)?;
    results.finish()?;
    work.report(section);
    print(format!("future {}", out.display()));
    Ok(ExitCode::SUCCESS)
}

/// The middle of what moves up to `to`, or of everything.
fn middle(predicted: &PredictedScene, [first, end]: [f64; 2], to: f64) -> DVec3 {
    let [positions, later] = [end, to].map(|time| to_host(predicted.scene.at(time).means.val()));
    let opacities = to_host(predicted.scene.at(first).opacities());
    let at = |values: &[f32], row: usize| DVec3::from_slice(&[0, 1, 2].map(|axis| f64::from(values[3 * row + axis])));
    let mean = |moving: bool| -> Option<DVec3> {
        let rows = (0..opacities.len()).filter(|row| !moving || at(&positions, *row) != at(&later, *row));
        let weighted = rows.map(|row| (at(&positions, row), f64::from(opacities[row])));
        let (sum, total) = weighted.fold((DVec3::ZERO, 0.0), |(sum, total), (x, w)| (sum + w * x, total + w));
        (total > 0.0).then(|| sum / total)
    };
    mean(true).or_else(|| mean(false)).unwrap_or(DVec3::ZERO)
}

impl Work<'_> {
    /// Checks that no file of somebody else would be written over.
    fn check(&self, dataset: &std::path::Path) -> Result<()> {
        let frames = self.shots.iter().flat_map(|shot| (0..self.times.len()).map(|k| self.placed.frame(shot, k)));
        let animations = self.shots.iter().map(|shot| self.placed.animation(shot));
        let single = figures::NAMES.iter().map(|name| self.placed.at(name));
        let ply = self.times.iter().filter(|_| self.args.ply).map(|time| self.placed.ply(&self.run_name(), *time));
        let paths: Vec<PathBuf> = frames.chain(animations).chain(single).chain(ply).collect();
        let photos = self.predicted.photos.held_out_views().chain(&self.predicted.photos.train);
        let named: Vec<PathBuf> = photos.map(|view| view.image_path.clone()).chain([dataset.to_path_buf()]).collect();
        outputs::check(&paths, &named)
    }

    fn run_name(&self) -> String {
        RunFolder::at(&self.args.run).name()
    }

    /// Draws and measures everything; returns the section for the report of the run.
    fn all(&self, future: Option<&dyn Extrapolation>, dataset: &std::path::Path) -> Result<String> {
        let mut figures = Figures::new(self);
        let mut shown = Vec::new();
        self.frames()?;
        let horizon = self.horizon(&mut figures)?;
        let (paths, count) = trajectories::draw(
            self.predicted.renderer,
            self.predicted.scene,
            self.shots[0].pose(0),
            (self.span, self.args.to),
            SEED,
        );
        self.files.picture("trajectories.png", &paths)?;
        let caption = format!("Paths of {}: seen in blue, the future in orange to red", counted(count, "Gaussian"));
        shown.push(Shown::Picture(paths, caption));
        for map in motion::maps(self.predicted.renderer, self.predicted.scene, self.shots[0].pose(0), self.times[0]) {
            self.files.picture(&format!("{}.png", map.name), &map.picture)?;
            let caption =
                format!("{}, the brightest colour is {:.3} {}", map.name.replace('_', " "), map.full, map.unit);
            shown.push(Shown::Picture(map.picture.clone(), caption));
            figures.maps.push(map);
        }
        match future {
            Some(future) => {
                if let Some((spread, map)) = self.ensemble(future, dataset, &mut shown)? {
                    figures.spread = Some(spread);
                    figures.maps.push(map);
                }
                figures.parts = self.parts(future)?;
            }
            None if self.args.bodies || self.args.members > 0 => {
                print("this run's pipeline knows no rigid parts and no ensemble: both are left out");
            }
            None => {}
        }
        figures.step = self.step_note()?;
        write_json(&self.files.at(figures::JSON), &figures)?;
        match &horizon {
            Some(horizon) => self.predicted.section(horizon, &shown),
            None => section::without_photos(&shown),
        }
    }

    /// Puts the section into the report of the run. One that cannot be written is no reason to fail: the results are in
    /// their folder.
    fn report(&self, section: String) {
        let folder = RunFolder::at(&self.args.run);
        // The report is about the run as it was trained.
        if !folder.report().is_file() || self.args.step.is_some() {
            return;
        }
        match add_to_report(&folder, &section) {
            Ok(()) => print(format!("report {}", folder.report().display())),
            Err(error) => tracing::warn!("{}; the report is left as it is", printable(&one_sentence(&error))),
        }
    }

    /// PSNR over time against photos of later times, where there are any.
    fn horizon(&self, figures: &mut Figures) -> Result<Option<crate::report::future::Horizon>> {
        let until = Some(self.args.to);
        let found = [Split::TEST, Split::TEST_SEEN].map(|split| self.predicted.horizon_of(split, until));
        let found: Vec<_> = found.into_iter().flatten().collect();
        let Some(first) = found.first().cloned() else {
            print("no photos of later times: the prediction is not measured");
            return Ok(None);
        };
        found.iter().for_each(|horizon| print(horizon.line()));
        write_atomic(&self.files.at("psnr_over_time.svg"), marked_svg(&first.chart().svg()).as_bytes())?;
        if let Some(strip) = self.predicted.strip(&first, until) {
            self.files.picture("strip.png", &strip)?;
        }
        figures.future = found;
        Ok(Some(first))
    }
}
