//! What a finished run shows: side-by-side pictures, curves, and one self-contained page with all of it.

pub mod charts;
mod labels;
pub mod maps;
mod page;
pub mod pictures;
pub mod scatter;

use anyhow::Result;
use gs_datasets::image_io::{write_atomic, write_png};

use crate::evaluate::Comparison;
use crate::experiment::Config;
use crate::profile::Profile;
use crate::run_folder::{EvalFile, MetricsLine, RunFolder};

use charts::{Chart, Series};
pub(crate) use page::{STYLE, escaped, with_comparison};
use pictures::SideBySide;

/// Writes renders/, plots/ and report.html of a run.
///
/// # Errors
/// When a file cannot be written; files written before stay.
pub fn write(
    folder: &RunFolder,
    eval: &EvalFile,
    history: &[MetricsLine],
    comparisons: &[Comparison],
    config: &Config,
) -> Result<()> {
    let pictures: Vec<SideBySide> = comparisons.iter().map(SideBySide::new).collect();
    for picture in &pictures {
        let path = folder.renders().join(format!("{}.png", picture.name));
        write_png(&path, picture.width, picture.height, &picture.pixels)?;
    }
    let mut plots = Vec::new();
    for (name, chart) in curves(history) {
        let svg = chart.svg();
        write_atomic(&folder.plots().join(format!("{name}.svg")), svg.as_bytes())?;
        plots.push(svg);
    }
    let page = page::html(eval, &plots, &pictures, Profile::read(folder).as_ref(), config)?;
    // What a chart of several runs put into an earlier report stays.
    let page = match std::fs::read_to_string(folder.comparison()) {
        Ok(section) => with_comparison(&page, &section).unwrap_or(page),
        Err(_) => page,
    };
    Ok(write_atomic(&folder.report(), page.as_bytes())?)
}

/// The curves of a run: quality, loss, count and work over steps.
fn curves(history: &[MetricsLine]) -> Vec<(&'static str, Chart)> {
    let over_steps = |value: &dyn Fn(&MetricsLine) -> Option<f64>| -> Vec<(f64, f64)> {
        history.iter().filter_map(|line| Some((line.step() as f64, value(line)?))).collect()
    };
    let train = |value: &dyn Fn(&crate::run_folder::TrainLine) -> Option<f64>| {
        over_steps(&|line| match line {
            MetricsLine::Train(line) => value(line),
            MetricsLine::Eval(_) => None,
        })
    };
    let held_out = over_steps(&|line| match line {
        MetricsLine::Eval(evaluation) => Some(evaluation.mean.psnr),
        MetricsLine::Train(_) => None,
    });
    let moving = over_steps(&|line| match line {
        MetricsLine::Eval(evaluation) => evaluation.moving.as_ref().map(|scores| scores.psnr),
        MetricsLine::Train(_) => None,
    });
    let chart = |title: &str, y: &str, series: Vec<Series>| Chart {
        title: title.into(),
        x: "step".into(),
        y: y.into(),
        series,
    };
    vec![
        (
            "psnr",
            chart(
                "Quality",
                "PSNR, dB",
                vec![
                    Series::line("training photo", charts::smoothed(&train(&|line| line.psnr))),
                    Series::dots("held-out mean", held_out),
                    Series::dots("held-out moving parts", moving),
                ]
                .into_iter()
                .filter(|series| !series.is_empty())
                .collect(),
            ),
        ),
        (
            "loss",
            chart(
                "Loss",
                "loss",
                vec![Series::line("loss", charts::smoothed(&train(&|line| line.loss.map(f64::from))))],
            ),
        ),
        (
            "gaussians",
            chart("Gaussians", "count", vec![Series::line("Gaussians", train(&|line| Some(line.gaussians as f64)))]),
        ),
        (
            "intersections",
            chart(
                "Work of one rendering",
                "tile intersections",
                vec![Series::line(
                    "tile intersections",
                    charts::smoothed(&train(&|line| Some(line.intersections as f64))),
                )],
            ),
        ),
    ]
}
