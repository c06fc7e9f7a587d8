//! `gsburn watch`: a run in the browser while it trains.

mod server;

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use anyhow::Result;
use burn::tensor::Device;
use serde::Serialize;

use self::server::{Answers, SCENE, STATE};
use crate::cli::WatchArgs;
use crate::commands::view::PageScene;
use crate::commands::{device, print};
use crate::report::curves;
use crate::report::viewer::{self, Packed};
use gs_train::run::checkpoint::{Checkpoint, Origin};
use gs_train::run::folder::{MetricsLine, RunFolder};
use gs_train::run::presentation::Camera;
use gs_train::run::scene::SceneFile;

/// How often the run folder is looked at.
const LOOK_EVERY: Duration = Duration::from_secs(2);

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
    let mut watcher = Watcher::new(folder, args.data.clone(), device);
    watcher.look(&answers);
    let port = server::start(args.port, answers.clone())?;
    print(format!("http://127.0.0.1:{port}/ shows {}; Ctrl-C ends this, not the training", args.run.display()));
    loop {
        std::thread::sleep(LOOK_EVERY);
        watcher.look(&answers);
    }
}

/// A file at a moment: another one of the same name differs in time or size.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Stamp {
    modified: SystemTime,
    bytes: u64,
}

impl Stamp {
    /// `None` where there is no such file.
    fn of(path: &Path) -> Option<Self> {
        let metadata = std::fs::metadata(path).ok()?;
        Some(Self { modified: metadata.modified().unwrap_or(UNIX_EPOCH), bytes: metadata.len() })
    }
}

/// A checkpoint as it was found.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Saved {
    step: usize,
    path: PathBuf,
    stamp: Stamp,
}

impl Saved {
    /// A name that no other checkpoint has: the page asks for a scene when it changes.
    fn version(&self) -> String {
        let since = self.stamp.modified.duration_since(UNIX_EPOCH).unwrap_or_default();
        format!("{}-{}-{}", self.step, since.as_nanos(), self.stamp.bytes)
    }
}

/// The contents of the run folder.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct Found {
    /// The checkpoint that is served.
    shown: Option<Saved>,
    /// The step of a newer one that cannot be read.
    damaged: Option<usize>,
    /// The metrics.
    metrics: Option<Stamp>,
    /// Whether there is no run any more.
    is_gone: bool,
}

/// The run as it was last seen.
struct Watcher {
    folder: RunFolder,
    data: Option<PathBuf>,
    device: Device,
    /// The contents when the state was last written.
    found: Option<Found>,
    /// Cameras, which stay as long as checkpoints are of the same run.
    cameras: Option<(Origin, Vec<Camera>)>,
    /// Checkpoints that cannot be read, each of which was named once.
    unreadable: Vec<Saved>,
}

/// The content of `/state.json`.
#[derive(Debug, Serialize)]
struct State {
    /// The scene that is served; `None`: none is.
    version: Option<String>,
    text: String,
    /// The curves as SVG.
    charts: Vec<String>,
}

impl Watcher {
    fn new(folder: RunFolder, data: Option<PathBuf>, device: Device) -> Self {
        Self { folder, data, device, found: None, cameras: None, unreadable: Vec::new() }
    }

    /// Reads what is new in the run folder.
    fn look(&mut self, answers: &Answers) {
        let metrics = Stamp::of(&self.folder.metrics());
        let is_gone = !self.folder.config().is_file();
        let (shown, damaged) = if is_gone { (None, None) } else { self.newest(answers) };
        let found = Found { shown, damaged, metrics, is_gone };
        if self.found.as_ref() != Some(&found) {
            let lines = self.folder.read_metrics(usize::MAX).unwrap_or_default();
            let charts = curves(&lines).into_iter().map(|(_, chart)| chart.svg()).collect();
            let version = found.shown.as_ref().map(Saved::version);
            let state = State { version, text: told(&lines, &found, &self.folder), charts };
            answers.set(STATE, serde_json::to_string(&state).expect("texts are JSON"));
            self.found = Some(found);
        }
    }

    /// Serves the newest checkpoint that can be read; returns it, and the step of a newer one that cannot.
    fn newest(&mut self, answers: &Answers) -> (Option<Saved>, Option<usize>) {
        let mut damaged = None;
        for (step, path) in self.folder.saved().into_iter().rev() {
            // The training removes old checkpoints.
            let Some(stamp) = Stamp::of(&path) else { continue };
            let saved = Saved { step, path, stamp };
            if self.is_shown(&saved) {
                return (Some(saved), damaged);
            }
            if !self.unreadable.contains(&saved) {
                match self.packed(&saved.path) {
                    Ok(Packed { json, block }) => {
                        let version = saved.version();
                        answers.set(
                            SCENE,
                            format!("{{\"version\":\"{version}\",\"scene\":{json},\"block\":\"{block}\"}}"),
                        );
                        return (Some(saved), damaged);
                    }
                    // It was removed or replaced while it was read: the next look finds the next one.
                    Err(_) if Stamp::of(&saved.path).as_ref() != Some(&saved.stamp) => continue,
                    Err(error) => {
                        tracing::warn!("{error:#}; the page shows the newest whole checkpoint");
                        self.unreadable.push(saved);
                    }
                }
            }
            damaged = damaged.or(Some(step));
        }
        (None, damaged)
    }

    fn is_shown(&self, saved: &Saved) -> bool {
        self.found.as_ref().and_then(|found| found.shown.as_ref()) == Some(saved)
    }

    fn packed(&mut self, path: &Path) -> Result<Packed> {
        let checkpoint = Checkpoint::load(path)?;
        let origin = checkpoint.origin.clone();
        let file = SceneFile::Checkpoint(Box::new(checkpoint));
        let opened = match &self.cameras {
            Some((of, cameras)) if *of == origin => {
                PageScene { cameras: cameras.clone(), ..PageScene::alone(&file, &self.device)? }
            }
            _ => PageScene::with_photos(&file, self.data.as_deref(), &self.device)?,
        };
        self.cameras = Some((origin, opened.cameras.clone()));
        Ok(opened.packed(&self.folder.name()))
    }
}

/// The run in a sentence or two.
fn told(lines: &[MetricsLine], found: &Found, folder: &RunFolder) -> String {
    if found.is_gone {
        return format!("{}: the run is gone; there is no config.toml any more.", folder.path().display());
    }
    let train = lines.iter().rev().find_map(|line| match line {
        MetricsLine::Train(line) => Some(line),
        MetricsLine::Eval(_) => None,
    });
    let now = train.map_or("no step yet".to_string(), |line| {
        let loss = line.loss.map_or(String::new(), |loss| format!(", loss {loss:.4}"));
        format!("step {}{loss}, {:.0} s", line.step, line.seconds)
    });
    let scene = match &found.shown {
        Some(saved) => format!("the scene is that of step {}", saved.step),
        None => "no checkpoint yet".into(),
    };
    let damaged = found.damaged.map_or(String::new(), |step| format!("; the checkpoint of step {step} cannot be read"));
    format!("{now}; {scene}{damaged}")
}
