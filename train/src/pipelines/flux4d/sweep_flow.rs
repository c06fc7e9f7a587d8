//! `gsburn flow`: scene flow of a log from its LiDAR sweeps alone, without images, labels and training.

use std::ops::Range;
use std::path::Path;
use std::time::Instant;

use anyhow::{Result, bail};
use burn::tensor::Device;
use glam::DMat4;
use gs_datasets::image_io::write_atomic;
use gs_datasets::{counted, write_npy};
use gs_driving::{DrivingLog, FLOW_INTERVAL, LogOptions, Sweep};
use gs_models::flux4d::fast_nsf::{FastNsfConfig, fit_flow};
use serde::Serialize;

use super::flow::{FlowOfSweep, FlowScores};
use super::start::aligned;
use crate::fit::figure::{Figure, FigureTable};
use crate::run::interrupt;
use crate::run::outputs::MARK;
use crate::run::results::Results;

/// The file with all figures.
const SUMMARY: &str = "flow.json";

/// Points of a sweep that a fit looks at; the flow is then evaluated on all. As many as the field's fits of pairs take.
pub const FIT_POINTS: usize = 8192;

/// What is asked for.
#[derive(Debug, Clone, Copy)]
pub struct SweepFlow<'a> {
    /// The log.
    pub log: &'a Path,
    /// Folder for arrays and figures, if they are wanted.
    pub out: Option<&'a Path>,
    /// Sweeps that are looked at together, 2 or more.
    pub window: usize,
    /// Iterations of a fit of every pair of sweeps, instead of the search for bodies.
    pub fit: Option<usize>,
    /// Of the fit.
    pub device: &'a Device,
}

#[derive(Debug, Serialize)]
struct Summary {
    program: &'static str,
    log: String,
    method: String,
    /// Metres in this many seconds.
    interval: f64,
    sweeps: usize,
    points: usize,
    seconds_per_sweep: f64,
    figures: Vec<Figure>,
    tables: Vec<FigureTable>,
}

/// A sweep, its number among the log's frames, and the flow of its points.
struct Found {
    frame: usize,
    sweep: Sweep,
    flow: Vec<[f32; 3]>,
}

/// Finds the flow of every point of every sweep, metres in [`FLOW_INTERVAL`], scores it where there are labels, and writes
/// `FRAME.npy` (`[points, 3]`, axes of the world, points as the log gives them) and `flow.json`. Returns lines for the terminal.
///
/// # Errors
/// One sentence: a log of one sweep, a broken file, a full disk, a folder with other files.
pub fn sweep_flow(request: &SweepFlow) -> Result<Vec<String>> {
    let log = DrivingLog::open(request.log, &LogOptions::default())?;
    let frames: Vec<usize> = (0..log.frames().len()).filter(|frame| log.frames()[*frame].has_sweep).collect();
    if frames.len() < 2 {
        bail!("{}: expected 2 sweeps or more, found {}", request.log.display(), frames.len());
    }
    let results = request.out.map(|out| Results::begin(out, SUMMARY)).transpose()?;
    let (mut scores, mut seconds, mut sweeps, mut points) = (FlowScores::default(), 0.0, 0, 0);
    for (window, new) in windows(frames.len(), request.window) {
        if interrupt::asked() {
            bail!("interrupted; {sweeps} of {} sweeps are done", frames.len());
        }
        let loaded = frames[window].iter().map(|frame| Ok((*frame, log.sweep(*frame)?)));
        let loaded = loaded.collect::<Result<Vec<_>>>()?;
        let begun = Instant::now();
        let found = match request.fit {
            None => by_bodies(&log, loaded),
            Some(iterations) => by_fit(&log, loaded, iterations, request.device)?,
        };
        seconds += begun.elapsed().as_secs_f64();
        for found in found.iter().filter(|found| found.frame >= frames[new]) {
            if let Some(labelled) = labelled(found) {
                scores.add(&labelled)?;
            }
            if let Some(results) = &results {
                let name = format!("{}.npy", log.frames()[found.frame].name);
                write_npy(&results.folder().join(name), &found.flow)?;
            }
            (sweeps, points) = (sweeps + 1, points + found.flow.len());
        }
    }
    let method = match request.fit {
        None => format!("bodies in windows of {} sweeps", request.window.min(frames.len())),
        Some(iterations) => {
            format!("a fit of each pair of sweeps, {FIT_POINTS} points, at most {iterations} iterations")
        }
    };
    let summary = Summary {
        program: MARK,
        log: log.name().to_string(),
        method,
        interval: FLOW_INTERVAL,
        sweeps,
        points,
        seconds_per_sweep: seconds / sweeps.max(1) as f64,
        figures: scores.figures(),
        tables: scores.table().into_iter().collect(),
    };
    if let Some(results) = results {
        let text = serde_json::to_string_pretty(&summary).expect("figures are JSON") + "\n";
        write_atomic(&results.folder().join(SUMMARY), text.as_bytes())?;
        results.finish()?;
    }
    Ok(lines(&summary, request.out))
}

/// Windows over all sweeps, and the first sweep that is new in each. The last window ends with the log, so it is not short.
fn windows(sweeps: usize, length: usize) -> Vec<(Range<usize>, usize)> {
    let length = length.clamp(2, sweeps.max(2));
    let window = |new: usize| {
        let first = new.min(sweeps.saturating_sub(length));
        (first..(first + length).min(sweeps), new)
    };
    (0..sweeps).step_by(length).map(window).collect()
}

fn by_bodies(log: &DrivingLog, loaded: Vec<(usize, Sweep)>) -> Vec<Found> {
    let motions = aligned(log, loaded.iter().map(|(frame, sweep)| (*frame, sweep)), &DMat4::IDENTITY);
    let flow_of = |place: usize, sweep: &Sweep| {
        let of_point = |(point, at): (usize, &[f32; 3])| {
            let (velocity, acceleration) = motions.motion(place, point, *at);
            let along = |axis: usize| {
                (velocity[axis] * FLOW_INTERVAL + 0.5 * acceleration[axis] * FLOW_INTERVAL * FLOW_INTERVAL) as f32
            };
            [along(0), along(1), 0.0]
        };
        sweep.points.iter().enumerate().map(of_point).collect()
    };
    let flows: Vec<Vec<[f32; 3]>> =
        loaded.iter().enumerate().map(|(place, (_, sweep))| flow_of(place, sweep)).collect();
    loaded.into_iter().zip(flows).map(|((frame, sweep), flow)| Found { frame, sweep, flow }).collect()
}

/// The last sweep of a log is fitted to the one before, backwards.
fn by_fit(log: &DrivingLog, loaded: Vec<(usize, Sweep)>, iterations: usize, device: &Device) -> Result<Vec<Found>> {
    let config = FastNsfConfig { iterations, points: Some(FIT_POINTS), ..FastNsfConfig::default() };
    let mut flows = Vec::new();
    for place in 0..loaded.len() {
        let (frame, sweep) = &loaded[place];
        let (other, target) = &loaded[if place + 1 < loaded.len() { place + 1 } else { place - 1 }];
        let seconds = log.frames()[*other].time - log.frames()[*frame].time;
        let scale = (FLOW_INTERVAL / seconds) as f32;
        let fitted = fit_flow(&sweep.points, &target.points, &config, device)?;
        flows.push(fitted.flow.into_iter().map(|flow| flow.map(|x| x * scale)).collect::<Vec<_>>());
    }
    Ok(loaded.into_iter().zip(flows).map(|((frame, sweep), flow)| Found { frame, sweep, flow }).collect())
}

/// The points of a sweep whose flow is known.
fn labelled(found: &Found) -> Option<FlowOfSweep> {
    let labels = found.sweep.labels.as_ref()?;
    let kept: Vec<usize> = (0..found.sweep.len()).filter(|index| labels.flow[*index].is_some()).collect();
    let predicted = kept.iter().map(|index| found.flow[*index]).collect();
    Some(FlowOfSweep::of(&found.sweep, labels, &kept, predicted))
}

fn lines(summary: &Summary, out: Option<&Path>) -> Vec<String> {
    let mut lines = vec![format!(
        "{}: {}, {} points, {}: {:.2} s a sweep",
        summary.log,
        counted(summary.sweeps, "sweep"),
        summary.points,
        summary.method,
        summary.seconds_per_sweep
    )];
    if summary.figures.is_empty() {
        lines.push("no point has a label, so nothing is scored".into());
    }
    let figure = |figure: &Figure| match figure.note.as_str() {
        "" => format!("  {:44} {}", figure.name, figure.shown()),
        note => format!("  {:44} {} ({note})", figure.name, figure.shown()),
    };
    lines.extend(summary.figures.iter().map(figure));
    lines.extend(summary.tables.iter().flat_map(FigureTable::lines));
    lines.extend(out.map(|out| format!("written to {}", out.display())));
    lines
}

#[cfg(test)]
mod tests {
    use super::windows;

    #[test]
    fn windows_hold_every_sweep_once() {
        for sweeps in 2..30 {
            for length in 2..9 {
                let mut done = Vec::new();
                for (window, new) in windows(sweeps, length) {
                    assert!(window.len() >= 2.min(sweeps) && window.end <= sweeps && window.contains(&new));
                    done.extend(window.filter(|sweep| *sweep >= new));
                }
                assert_eq!(done, (0..sweeps).collect::<Vec<_>>(), "{sweeps} sweeps in windows of {length}");
            }
        }
    }
}
