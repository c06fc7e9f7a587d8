//! `gsburn flow`: scene flow of a log from its LiDAR sweeps alone, without images, labels and training.

use std::ops::Range;
use std::path::Path;
use std::time::Instant;

use anyhow::{Result, bail};
use burn::tensor::Device;
use glam::DMat4;
use gs_base::npy::write_npy;
use gs_base::{agree, counted, printable};
use gs_driving::{DrivingLog, FLOW_INTERVAL, LogOptions, Sweep, gaps, runs};
use gs_models::flux4d::fast_nsf::{FastNsfConfig, fit_flow};
use serde::Serialize;

use super::protocol::{Protocol, Scores};
use super::start::SweepMotions;
use gs_train::fit::figure::{Figure, FigureTable};
use gs_train::run::interrupt;
use gs_train::run::outputs::{MARK, write_json};
use gs_train::run::results::Results;

/// The file with all figures.
const SUMMARY: &str = "flow.json";

/// Points of a sweep that a fit looks at; the flow is then evaluated on all. As many as the field's fits of pairs take.
pub const FIT_POINTS: usize = 8192;

/// A request for the flow of a log.
#[derive(Debug, Clone, Copy)]
pub struct SweepFlow<'a> {
    /// The log.
    pub log: &'a Path,
    /// Folder for arrays and figures, if they are wanted.
    pub out: Option<&'a Path>,
    /// Sweeps that are looked at together, 2 or more.
    pub window: usize,
    /// The points that are scored.
    pub protocol: Protocol,
    /// Iterations of a fit of every pair of sweeps, instead of the search for bodies.
    pub fit: Option<usize>,
    /// Device of the fit.
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

/// Finds the flow of every point of every sweep, metres in [`FLOW_INTERVAL`], scores it where there are labels, and
/// writes `FRAME.npy` (`[points, 3]`, axes of the world, points as the log gives them) and `flow.json`. Returns lines
/// for the terminal.
///
/// # Errors
/// One sentence: a log of one sweep, a broken file, a full disk, a folder with other files.
pub fn sweep_flow(request: &SweepFlow) -> Result<Vec<String>> {
    let log = DrivingLog::open(request.log, &LogOptions::default())?;
    log.warnings().iter().for_each(|warning| tracing::warn!("{}", printable(warning)));
    let frames: Vec<usize> = (0..log.frames().len()).filter(|frame| log.frames()[*frame].has_sweep).collect();
    let windows = windows(&frames.iter().map(|frame| log.frames()[*frame].time).collect::<Vec<_>>(), request.window);
    let compared = windows.iter().map(|(window, new)| window.end - new).sum::<usize>();
    warn_of_gaps(&log, frames.len() - compared);
    if windows.is_empty() {
        let (path, found) = (request.log.display(), frames.len());
        bail!("{path}: expected 2 sweeps or more without a gap in the recording, found {found} in all");
    }
    let results = request.out.map(|out| Results::begin(out, SUMMARY)).transpose()?;
    let (mut scores, mut seconds, mut sweeps, mut points) = (Scores::new(request.protocol, &log)?, 0.0, 0, 0);
    for (window, new) in windows {
        if interrupt::asked() {
            bail!("interrupted; {sweeps} of {compared} sweeps are done");
        }
        let loaded = frames[window].iter().map(|frame| Ok((*frame, log.labelled_sweep(*frame)?)));
        let loaded = loaded.collect::<Result<Vec<_>>>()?;
        let begun = Instant::now();
        let found = match request.fit {
            None => by_bodies(&log, loaded),
            Some(iterations) => by_fit(&log, loaded, iterations, request.device)?,
        };
        seconds += begun.elapsed().as_secs_f64();
        for found in found.iter().filter(|found| found.frame >= frames[new]) {
            scores.add(&log, found.frame, &found.sweep, &found.flow)?;
            if let Some(results) = &results {
                let name = format!("{}.npy", log.frames()[found.frame].name);
                write_npy(&results.folder().join(name), &found.flow)?;
            }
            (sweeps, points) = (sweeps + 1, points + found.flow.len());
        }
    }
    let method = match request.fit {
        None => format!("bodies in windows of {} sweeps", request.window.min(compared)),
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
        write_json(&results.folder().join(SUMMARY), &summary)?;
        results.finish()?;
    }
    Ok(lines(&summary, request.out))
}

/// Says where no motion is looked for: over the gaps of a recording, and in sweeps without another one beside them.
fn warn_of_gaps(log: &DrivingLog, alone: usize) {
    if let Some(gaps) = gaps(log.frames()) {
        tracing::warn!("the recording has {gaps}, over which no motion is looked for");
    }
    if alone > 0 {
        let (sweeps, have) = (counted(alone, "sweep"), agree(alone, "has", "have"));
        tracing::warn!(
            "{sweeps} {have} no other without a gap before or after and {} left out",
            agree(alone, "is", "are")
        );
    }
}

/// Windows over the sweeps of a recording, whose times (seconds) ascend, and the first sweep that is new in each. None
/// reaches over a gap, and a sweep between two gaps is in none. The last window of a run ends with it, so it is not
/// short.
fn windows(times: &[f64], length: usize) -> Vec<(Range<usize>, usize)> {
    let of_run = |run: Range<usize>| {
        let length = length.clamp(2, run.len());
        let window = move |new: usize| {
            let first = new.min(run.end - length);
            (first..first + length, new)
        };
        (run.start..run.end).step_by(length).map(window)
    };
    runs(times).into_iter().filter(|run| run.len() >= 2).flat_map(of_run).collect()
}

fn by_bodies(log: &DrivingLog, loaded: Vec<(usize, Sweep)>) -> Vec<Found> {
    let motions = SweepMotions::of(log, loaded.iter().map(|(frame, sweep)| (*frame, sweep)), &DMat4::IDENTITY);
    let flow_of = |place: usize, sweep: &Sweep| {
        let of_point = |(point, at): (usize, &[f32; 3])| {
            let (velocity, acceleration) = motions.at(place, point, *at);
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

/// The last sweep of a window is fitted to the one before, backwards.
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

    /// A recording of 10 sweeps a second that is interrupted for 20 s before sweep `gap`.
    fn times(sweeps: usize, gap: usize) -> Vec<f64> {
        (0..sweeps).map(|i| 0.1 * i as f64 + if i >= gap { 20.0 } else { 0.0 }).collect()
    }

    fn done(times: &[f64], length: usize) -> Vec<usize> {
        let mut done = Vec::new();
        for (window, new) in windows(times, length) {
            assert!(window.len() >= 2 && window.end <= times.len() && window.contains(&new));
            assert!(times[window.end - 1] - times[window.start] < 10.0, "{window:?} reaches over the gap");
            done.extend(window.filter(|sweep| *sweep >= new));
        }
        done
    }

    #[test]
    fn windows_hold_every_sweep_once() {
        for sweeps in 2..30 {
            for length in 2..9 {
                let all: Vec<usize> = (0..sweeps).collect();
                assert_eq!(done(&times(sweeps, sweeps), length), all, "{sweeps} sweeps in windows of {length}");
            }
        }
    }

    #[test]
    fn no_window_reaches_over_a_gap() {
        for length in 2..9 {
            for gap in 2..20 {
                assert_eq!(done(&times(22, gap), length), (0..22).collect::<Vec<_>>(), "a gap before {gap}");
            }
            // A first sweep alone has nothing to be compared with.
            assert_eq!(done(&times(22, 1), length), (1..22).collect::<Vec<_>>());
        }
        assert!(windows(&[5.0], 6).is_empty() && windows(&[], 6).is_empty());
    }
}
