//! `gsburn watch`: a run in the browser while it trains.

mod server;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Duration;

use anyhow::Result;
use burn::tensor::Device;
use serde::Serialize;

use self::server::Answers;
use crate::cli::WatchArgs;
use crate::commands::view::Opened;
use crate::commands::{device, print};
use crate::report::charts::smoothed;
use crate::report::viewer::{self, Camera, Packed};
use crate::run::checkpoint::Checkpoint;
use crate::run::folder::{MetricsLine, RunFolder};
use crate::run::scene::SceneFile;

/// How often the run folder is looked at.
const LOOK_EVERY: Duration = Duration::from_secs(2);

/// Most points of a curve in the page.
const POINTS_MAX: usize = 200;

/// Serves the page until Ctrl-C.
///
/// # Errors
/// A sentence when there is no run, or the port is taken.
pub fn run(args: &WatchArgs) -> Result<ExitCode> {
    let device = device(&args.device)?;
    let folder = RunFolder::at(&args.run);
    folder.read_config()?;
    let page = viewer::live_page(&folder.name(), include_str!("live.css"), include_str!("live.js"));
    let answers = Arc::new(Answers::new(page));
    let mut watcher = Watcher { folder, data: args.data.clone(), device, shown: None, cameras: None, seen: None };
    watcher.look(&answers);
    let port = server::start(args.port, answers.clone())?;
    print(format!("http://127.0.0.1:{port}/ shows {}; Ctrl-C ends this, not the training", args.run.display()));
    loop {
        std::thread::sleep(LOOK_EVERY);
        watcher.look(&answers);
    }
}

/// What is known of the run.
struct Watcher {
    folder: RunFolder,
    data: Option<PathBuf>,
    device: Device,
    /// Step of the checkpoint that is served.
    shown: Option<usize>,
    /// Its cameras, which stay.
    cameras: Option<Vec<Camera>>,
    /// Length of the metrics and the step served, when the state was last written.
    seen: Option<(u64, Option<usize>)>,
}

/// The content of `/state.json`.
#[derive(Debug, Serialize)]
struct State {
    version: Option<usize>,
    text: String,
    curves: Vec<Curve>,
}

#[derive(Debug, Serialize)]
struct Curve {
    name: &'static str,
    points: Vec<(f64, f64)>,
}

impl Watcher {
    /// Reads what is new in the run folder.
    fn look(&mut self, answers: &Answers) {
        if let Some((step, path)) = self.folder.saved().pop().filter(|(step, _)| self.shown != Some(*step)) {
            match self.packed(&path) {
                Ok(Packed { json, block }) => {
                    answers.set_scene(format!("{{\"version\":{step},\"scene\":{json},\"block\":\"{block}\"}}"));
                    self.shown = Some(step);
                }
                // The training removes old checkpoints; the next look finds the next one.
                Err(error) => tracing::warn!("{error:#}"),
            }
        }
        let length = std::fs::metadata(self.folder.metrics()).map_or(0, |metadata| metadata.len());
        if self.seen != Some((length, self.shown)) {
            let lines = self.folder.read_metrics(usize::MAX).unwrap_or_default();
            let state = State { version: self.shown, text: told(&lines, self.shown), curves: curves(&lines) };
            answers.set_state(serde_json::to_string(&state).expect("numbers are JSON"));
            self.seen = Some((length, self.shown));
        }
    }

    fn packed(&mut self, path: &Path) -> Result<Packed> {
        let file = SceneFile::Checkpoint(Box::new(Checkpoint::load(path)?));
        let opened = match &self.cameras {
            None => Opened::with_photos(&file, self.data.as_deref(), &self.device)?,
            Some(cameras) => Opened { cameras: cameras.clone(), ..Opened::alone(&file, &self.device)? },
        };
        self.cameras = Some(opened.cameras.clone());
        Ok(opened.packed(&self.folder.name()))
    }
}

/// The run in one sentence.
fn told(lines: &[MetricsLine], shown: Option<usize>) -> String {
    let train = lines.iter().rev().find_map(|line| match line {
        MetricsLine::Train(line) => Some(line),
        MetricsLine::Eval(_) => None,
    });
    let now = train.map_or("no step yet".to_string(), |line| {
        let loss = line.loss.map_or(String::new(), |loss| format!(", loss {loss:.4}"));
        format!("step {}{loss}, {:.0} s", line.step, line.seconds)
    });
    match shown {
        Some(step) => format!("{now}; the scene is that of step {step}"),
        None => format!("{now}; no checkpoint yet"),
    }
}

/// The curves of the page.
fn curves(lines: &[MetricsLine]) -> Vec<Curve> {
    let of = |name: &'static str, smooth: bool, value: &dyn Fn(&MetricsLine) -> Option<f64>| {
        let points: Vec<(f64, f64)> =
            lines.iter().filter_map(|line| Some((line.step() as f64, value(line)?))).collect();
        let points = if smooth { smoothed(&points) } else { points };
        let every = points.len().div_ceil(POINTS_MAX).max(1);
        // Counted from the end, so that the newest is among them.
        let mut thinned: Vec<(f64, f64)> = points.into_iter().rev().step_by(every).collect();
        thinned.reverse();
        Curve { name, points: thinned }
    };
    let train = |line: &MetricsLine| match line {
        MetricsLine::Train(line) => Some(line.clone()),
        MetricsLine::Eval(_) => None,
    };
    vec![
        of("training photos, PSNR in dB", true, &|line| train(line)?.psnr),
        of("loss", true, &|line| train(line)?.loss.map(f64::from)),
        of("held-out mean, PSNR in dB", false, &|line| match line {
            MetricsLine::Eval(evaluation) => Some(evaluation.mean().psnr),
            MetricsLine::Train(_) => None,
        }),
    ]
}
