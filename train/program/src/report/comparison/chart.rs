//! One chart of several runs: their last quality over their cost, and those that nothing beats.

use super::{ComparedRun, by_cpu, pareto_front, seconds};
use crate::report::charts::{Chart, Series};
use gs_train::run::measured::Evaluation;

/// Counts of Gaussians that differ by less than this share are equal, and a chart over them would show nothing.
const SAME_COUNT: f64 = 0.05;

/// The PSNR of each run at its end, of moving parts where all measured them, over its Gaussians, or over seconds of
/// training where the counts hardly differ.
pub fn chart(runs: &[ComparedRun]) -> Chart {
    let ends: Vec<&Evaluation> = runs.iter().map(|run| &run.eval.last).collect();
    let counts: Vec<f64> = ends.iter().map(|end| end.measured.size.gaussians as f64).collect();
    let [low, high] = counts.iter().fold([f64::INFINITY, 0.0], |[low, high], n| [n.min(low), n.max(high)]);
    let cpu = by_cpu(runs);
    let (x, costs) = match high > low * (1.0 + SAME_COUNT) {
        true => ("Gaussians", counts),
        false if cpu => ("CPU seconds of training, all threads", ends.iter().map(|end| seconds(end, true)).collect()),
        false => ("wall-clock seconds of training", ends.iter().map(|end| seconds(end, false)).collect()),
    };
    let moving: Option<Vec<f64>> = ends.iter().map(|end| end.moving().map(|scores| scores.psnr)).collect();
    let (y, psnr) = match moving {
        Some(psnr) => ("held-out PSNR of moving parts, dB", psnr),
        None => ("held-out PSNR, dB", ends.iter().map(|end| end.mean().psnr).collect()),
    };
    let points: Vec<(f64, f64)> = costs.into_iter().zip(psnr).collect();
    let front = pareto_front(&points);
    let mut best: Vec<(f64, f64)> = points.iter().zip(front).filter(|(_, on)| *on).map(|(point, _)| *point).collect();
    best.sort_by(|a, b| a.0.total_cmp(&b.0));
    let series = vec![Series::dots("runs", points), Series::line_and_dots("best at its cost", best)];
    Chart { title: "Accuracy against cost".into(), x: x.into(), y: y.into(), series }
}
