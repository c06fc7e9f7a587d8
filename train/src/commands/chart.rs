//! `gsburn chart`: accuracy against time and against count, over several runs.

use std::fmt::Write as _;
use std::process::ExitCode;

use anyhow::{Result, bail};
use gs_datasets::image_io::write_atomic;

use crate::cli::ChartArgs;
use crate::commands::print;
use crate::evaluate::Evaluation;
use crate::memory::megabytes;
use crate::report::charts::{Chart, Series};
use crate::run_folder::{EvalFile, RunFolder};

/// Draws the charts and writes the table.
///
/// # Errors
/// One sentence, when a run has no figures or a file cannot be written.
pub fn run(args: &ChartArgs) -> Result<ExitCode> {
    if args.out.extension().and_then(|extension| extension.to_str()) != Some("svg") {
        bail!("{}: expected the name of an .svg file", args.out.display());
    }
    let runs: Vec<EvalFile> = args.runs.iter().map(|path| RunFolder::at(path).read_eval()).collect::<Result<_>>()?;
    // Moving parts are what runs on moving scenes are compared by.
    let moving = runs.iter().all(|run| run.evaluations.iter().all(|e| e.moving.is_some()));
    let by_seconds = scatter(&runs, "Accuracy against training time", "seconds", moving, &|e| e.seconds);
    let by_count = scatter(&runs, "Accuracy against size", "Gaussians", moving, &|e| e.gaussians as f64);
    write_atomic(&args.out, stacked(&[by_seconds.svg(), by_count.svg()]).as_bytes())?;
    let table_path = args.out.with_extension("md");
    let table = table(&runs);
    write_atomic(&table_path, table.as_bytes())?;
    print(table.trim_end());
    print(format!("chart {}\ntable {}", args.out.display(), table_path.display()));
    Ok(ExitCode::SUCCESS)
}

/// Every run as a line through its measurements, and the front of what no other measurement beats.
fn scatter(runs: &[EvalFile], title: &str, x: &str, moving: bool, of: &dyn Fn(&Evaluation) -> f64) -> Chart {
    let points =
        |run: &EvalFile| -> Vec<(f64, f64)> { run.evaluations.iter().map(|e| (of(e), quality(e, moving))).collect() };
    let all: Vec<(f64, f64)> = runs.iter().flat_map(points).collect();
    let y = if moving { "held-out PSNR of moving parts, dB" } else { "held-out PSNR, dB" };
    let mut series: Vec<Series> = runs.iter().map(|run| Series::line_and_dots(&run.name, points(run))).collect();
    series.push(Series::front("best at its cost (Pareto front)", pareto_front(&all)));
    Chart { title: title.into(), x: x.into(), y: y.into(), series }
}

fn quality(evaluation: &Evaluation, moving: bool) -> f64 {
    match &evaluation.moving {
        Some(scores) if moving => scores.psnr,
        _ => evaluation.mean.psnr,
    }
}

/// The points for which no other has both less cost and more quality, by rising cost.
pub fn pareto_front(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.total_cmp(&a.1)));
    let mut front: Vec<(f64, f64)> = Vec::new();
    for point in sorted {
        if front.last().is_none_or(|best| point.1 > best.1) {
            front.push(point);
        }
    }
    front
}

/// A Markdown table with one row per measurement.
fn table(runs: &[EvalFile]) -> String {
    let mut text = String::from(
        "| run | cap | step | PSNR, dB | SSIM | MS-SSIM | LPIPS | moving parts, dB | Gaussians | moving | mean order | size | seconds | \
         CPU s a step | peak memory |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    let optional = |value: Option<f64>| value.map_or("–".into(), |v| format!("{v:.4}"));
    for run in runs {
        for e in &run.evaluations {
            let cpu = e.cpu_seconds.map_or("–".into(), |cpu| format!("{:.3}", cpu / e.step.max(1) as f64));
            writeln!(
                text,
                "| {} | {} | {} | {:.2} | {:.4} | {} | {} | {} | {} | {} | {} | {} | {:.1} | {cpu} | {} |",
                run.name,
                run.cap,
                e.step,
                e.mean.psnr,
                e.mean.ssim,
                optional(e.mean.ms_ssim),
                optional(e.mean.lpips),
                e.moving.as_ref().map_or("–".into(), |scores| format!("{:.2}", scores.psnr)),
                e.gaussians,
                e.motion.as_ref().map_or("–".into(), |motion| motion.cost.moving.to_string()),
                e.motion.as_ref().map_or("–".into(), |motion| format!("{:.2}", motion.cost.mean_order)),
                megabytes(e.motion.as_ref().map_or(e.bytes, |motion| motion.cost.bytes) as u64),
                e.seconds,
                e.peak_memory_bytes.map_or("–".into(), megabytes)
            )
            .expect("writing to a string does not fail");
        }
    }
    text
}

/// SVG images of equal width, one below the other.
fn stacked(images: &[String]) -> String {
    let (width, height) = crate::report::charts::SIZE;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{total}\" viewBox=\"0 0 {width} {total}\">\n",
        total = height * images.len() as u32
    );
    for (index, image) in images.iter().enumerate() {
        writeln!(svg, "<g transform=\"translate(0 {})\">{image}</g>", height * index as u32)
            .expect("writing to a string does not fail");
    }
    svg + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_front_holds_what_nothing_beats() {
        let points = [(3.0, 30.0), (1.0, 20.0), (2.0, 19.0), (4.0, 29.0), (1.0, 18.0), (5.0, 31.0)];
        assert_eq!(pareto_front(&points), [(1.0, 20.0), (3.0, 30.0), (5.0, 31.0)]);
        assert!(pareto_front(&[]).is_empty());
    }
}
