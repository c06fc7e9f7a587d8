//! The report of a finished run: side-by-side pictures, curves, and one self-contained page.

pub mod axis;
mod cards;
pub mod charts;
pub mod comparison;
pub mod future;
pub mod html;
mod legend;
pub mod maps;
mod meanings;
mod page;
pub mod pictures;
mod profile;
pub mod timetable;
pub mod viewer;

use anyhow::Result;
use gs_base::{guarded, write_atomic};
use gs_datasets::image_io::write_png;

use gs_train::fit::timetable::Timetable;
use gs_train::run::folder::{EvalFile, MetricsLine, RunFolder, TrainLine};
use gs_train::run::memory::megabytes;
use gs_train::run::outcome::{Contents, Outcome, ScenePhotos};
use gs_train::run::presentation::PresentedScene;
use gs_train::run::profile::Profile;
use gs_train::run::watch::SCHEDULE;

use charts::{Chart, Series};
use future::{PredictedScene, SceneRenderer};
pub use page::{COMPARISON, FUTURE, section_page, with_section};
use pictures::SideBySide;

/// Largest section kept beside a report, bytes: a row of a table takes some 500 bytes, and a page with a million
/// measurements is read by nobody.
const SECTION_MAX: u64 = 64 << 20;

/// Draws the report of a finished training and ends its run; returns its figures.
///
/// # Errors
/// When one of the last files of the run could not be written; the others are.
pub fn finish(folder: &RunFolder, outcome: Outcome) -> Result<EvalFile> {
    let Outcome { eval, report } = outcome;
    let Some(mut contents) = report else { return Ok(eval) };
    let mut files = std::mem::take(&mut contents.files);
    files.tried("report.html", write(folder, &eval, &contents).and_then(|()| add_future(folder, &eval, &contents)));
    files.done()?;
    if let Some(peak) = eval.last.cost.peak_memory_bytes {
        tracing::info!("peak memory {} (expected {})", megabytes(peak), megabytes(eval.predicted_memory_bytes));
    }
    Ok(eval)
}

/// The chart of a schedule as SVG.
pub fn schedule_svg(schedule: &Timetable) -> String {
    timetable::chart(schedule).svg()
}

/// Adds the future to the report, where cameras that are held out saw one.
fn add_future(folder: &RunFolder, eval: &EvalFile, contents: &Contents) -> Result<()> {
    let (Some(presented), Some(photos)) = (&contents.scene, &contents.photos) else { return Ok(()) };
    let ScenePhotos { photos, facts, render, device } = photos;
    let renderer = SceneRenderer { facts: *facts, render: render.clone(), device: device.clone() };
    let predicted =
        PredictedScene { renderer: &renderer, scene: &*presented.scene, photos, measured: Some(&eval.last.measured) };
    match predicted.horizon(None) {
        Some(horizon) => future::add_to_report(folder, &predicted.section(&horizon, &[])?),
        None => Ok(()),
    }
}

/// Writes renders/, plots/ and report.html of a run.
///
/// # Errors
/// When a file cannot be written; files written before are kept.
pub fn write(folder: &RunFolder, eval: &EvalFile, contents: &Contents) -> Result<()> {
    let pictures: Vec<SideBySide> = contents.pictures.iter().map(SideBySide::new).collect();
    for picture in &pictures {
        let path = folder.renders().join(format!("{}.png", picture.name));
        write_png(&path, picture.width, picture.height, &picture.pixels)?;
    }
    let mut plots = Vec::new();
    let schedule = contents.schedule.as_ref().map(|schedule| (SCHEDULE.to_string(), timetable::chart(schedule)));
    for (name, chart) in curves(&contents.history).into_iter().chain(schedule) {
        let svg = chart.svg();
        write_atomic(&folder.plots().join(format!("{name}.svg")), svg.as_bytes())?;
        plots.push(svg);
    }
    let scene = contents
        .scene
        .as_ref()
        .map(|PresentedScene { scene, presentation }| viewer::section(&viewer::packed(&**scene, presentation)));
    let page = page::whole(eval, &plots, &pictures, (scene, Profile::read(folder).as_ref()), &contents.config)?;
    // Sections that later commands put into an earlier report are kept.
    let kept = [(folder.comparison(), COMPARISON), (folder.future(), FUTURE)];
    let page = kept.into_iter().fold(page, |page, (path, place)| {
        let section = guarded::read_to_string(&path, SECTION_MAX).ok();
        section.and_then(|text| with_section(&page, place, page::section_of(&text, place))).unwrap_or(page)
    });
    Ok(write_atomic(&folder.report(), page.as_bytes())?)
}

/// The curves of a run so far with their names in files: quality, loss and every count over steps.
pub fn curves(history: &[MetricsLine]) -> Vec<(String, Chart)> {
    let over_steps = |value: &dyn Fn(&MetricsLine) -> Option<f64>| -> Vec<(f64, f64)> {
        history.iter().filter_map(|line| Some((line.step() as f64, value(line)?))).collect()
    };
    let train = |value: &dyn Fn(&TrainLine) -> Option<f64>| {
        over_steps(&|line| match line {
            MetricsLine::Train(line) => value(line),
            MetricsLine::Eval(_) => None,
        })
    };
    let held_out = |region: Option<&str>| {
        over_steps(&|line| match line {
            MetricsLine::Eval(evaluation) => match region {
                None => Some(evaluation.mean().psnr),
                Some(name) => evaluation.measured.quality.regions.get(name).map(|scores| scores.psnr),
            },
            MetricsLine::Train(_) => None,
        })
    };
    let chart = |title: &str, y: &str, series: Vec<Series>| Chart {
        title: title.into(),
        x: "step".into(),
        y: y.into(),
        series,
    };
    let mut regions: Vec<&String> = Vec::new();
    let mut counts: Vec<&String> = Vec::new();
    for line in history {
        let (names, all): (Vec<&String>, _) = match line {
            MetricsLine::Eval(evaluation) => (evaluation.measured.quality.regions.keys().collect(), &mut regions),
            MetricsLine::Train(line) => (line.counts.keys().collect(), &mut counts),
        };
        for name in names {
            if !all.contains(&name) {
                all.push(name);
            }
        }
    }
    let mut quality = vec![
        Series::line("training photo", charts::course(&charts::smoothed(&train(&|line| line.psnr)))),
        Series::dots("held-out mean", held_out(None)),
    ];
    quality.extend(regions.iter().map(|name| Series::dots(&format!("held-out {name} parts"), held_out(Some(name)))));
    quality.retain(Series::is_visible);
    let loss = charts::course(&charts::smoothed(&train(&|line| line.loss.map(f64::from))));
    let mut curves = vec![
        ("psnr".to_string(), chart("Quality", "PSNR, dB", quality)),
        ("loss".to_string(), chart("Loss", "loss", vec![Series::line("loss", loss)])),
    ];
    for name in counts {
        let values = charts::course(&train(&|line| line.counts.get(name).copied()));
        let file = name.to_lowercase().replace(' ', "-");
        curves.push((file, chart(name, name, vec![Series::line(name, values)])));
    }
    curves.retain(|(_, chart)| chart.has_course());
    curves
}
