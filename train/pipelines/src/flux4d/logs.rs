//! The logs of a folder, which of them train, and their snippets.

use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use gs_base::{agree, counted, printable};
use gs_datasets::some_names;
use gs_driving::{
    CameraUse, DrivingLog, LogFormat, LogOptions, Snippet, TEST_LOGS, TEST_LOGS_ARGOVERSE, logs_in, runs,
    snippets_without_gaps,
};

use super::config::{CameraChoice, LogsConfig, SplitChoice};
use gs_train::run::fingerprint::Fingerprint;

/// One of so many logs is held out where the configuration names none and asks for no other split.
const ONE_IN: usize = 8;

/// A snippet of one of the logs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// Place in [`Logs::logs`].
    pub log: usize,
    /// Its frames.
    pub snippet: Snippet,
}

/// The logs of a folder.
#[derive(Debug)]
pub struct Logs {
    /// The logs by name.
    pub logs: Vec<DrivingLog>,
    /// Snippets to train on; all of a data set that is measured alone.
    pub train: Vec<Place>,
    /// Snippets that are measured; those of training where no log is held out.
    pub held_out: Vec<Place>,
    /// Name of the split of `held_out`.
    pub split: &'static str,
}

impl Logs {
    /// Describes the logs at `path`: one log, or a folder of logs. No sweep or image is decoded.
    ///
    /// # Errors
    /// One sentence: no log, a log that cannot be read, a log without cameras or with too few frames, a name that no
    /// log has.
    pub fn open(path: &Path, config: &LogsConfig) -> Result<Self> {
        let mut logs = Self::unseen(path, config)?;
        (logs.train, logs.held_out, logs.split) = logs.divided(path, config)?;
        Ok(logs)
    }

    /// As [`Self::open`], for measuring a network that was trained on the frames of `trained`. Logs of another data set
    /// are all held out, unless the split `is_asked` for.
    ///
    /// # Errors
    /// As [`Self::open`], but for names that no log of another data set has.
    pub fn open_to_measure(path: &Path, config: &LogsConfig, trained: &Fingerprint, is_asked: bool) -> Result<Self> {
        let mut logs = Self::unseen(path, config)?;
        match logs.divided(path, config) {
            Ok((train, held_out, split)) if is_asked || fingerprint(&logs.logs, &train) == *trained => {
                (logs.train, logs.held_out, logs.split) = (train, held_out, split);
            }
            Err(error) if is_asked => return Err(error),
            // A split of the training logs says nothing of others, also where they have the same names.
            _ => (),
        }
        Ok(logs)
    }

    /// Describes logs of which none was trained on: all are held out, whatever split the configuration has.
    ///
    /// # Errors
    /// As [`Self::open`], but for the split.
    pub fn unseen(path: &Path, config: &LogsConfig) -> Result<Self> {
        let logs: Vec<DrivingLog> = find(path)?.iter().map(|path| open(path, config)).collect::<Result<_>>()?;
        let places_of = |(log, described): (usize, &DrivingLog)| -> Vec<Place> {
            snippets(&times(described), config).into_iter().map(|snippet| Place { log, snippet }).collect()
        };
        let train: Vec<Place> = logs.iter().enumerate().flat_map(places_of).collect();
        let held_out = by_log(&train).flat_map(|places| spread(places, config.validation_snippets)).collect();
        Ok(Self { logs, train, held_out, split: "unseen" })
    }

    /// The snippets of all logs as the configuration divides them: those that train, those that are measured, and the
    /// name of the split.
    fn divided(&self, path: &Path, config: &LogsConfig) -> Result<(Vec<Place>, Vec<Place>, &'static str)> {
        let is_held_out = held_out(path, &self.logs, config)?;
        let (mut train, mut validation) = (Vec::new(), Vec::new());
        for (places, is_held_out) in by_log(&self.train).zip(is_held_out) {
            match is_held_out {
                true => validation.extend(spread(places, config.validation_snippets)),
                false => train.extend_from_slice(places),
            }
        }
        if train.is_empty() {
            bail!(
                "{}: expected a log to train on, found that all are held out (logs.validation, logs.split)",
                path.display()
            );
        }
        Ok(match validation.is_empty() {
            true => (train.clone(), spread(&train, config.validation_snippets), "train"),
            false => (train, validation, "validation"),
        })
    }

    /// Says on stderr what was left out of the logs.
    pub fn warn(&self) {
        self.logs.iter().for_each(warn);
    }

    /// The fingerprint of the frames that train: names, times and poses.
    pub fn fingerprint(&self) -> Fingerprint {
        fingerprint(&self.logs, &self.train)
    }

    /// The name of a snippet: log and first frame.
    pub fn name(&self, place: &Place) -> String {
        format!("{}-{:03}", self.logs[place.log].name(), place.snippet.frames[0])
    }
}

/// The places by log; every log has at least one.
fn by_log(places: &[Place]) -> impl Iterator<Item = &[Place]> {
    places.chunk_by(|a, b| a.log == b.log)
}

/// The fingerprint of the frames of `places`: names, times and poses.
fn fingerprint(logs: &[DrivingLog], places: &[Place]) -> Fingerprint {
    let mut hasher = crc32fast::Hasher::new();
    for place in places {
        let log = &logs[place.log];
        hasher.update(log.name().as_bytes());
        for frame in place.snippet.frames.iter().map(|frame| &log.frames()[*frame]) {
            hasher.update(&frame.time.to_le_bytes());
            frame.ego.to_cols_array().iter().for_each(|x| hasher.update(&x.to_le_bytes()));
        }
    }
    Fingerprint { views: places.len(), crc32: hasher.finalize() }
}

/// Describes one log.
///
/// # Errors
/// One sentence: it cannot be read, has no camera of the choice, or too few frames.
pub fn open(path: &Path, config: &LogsConfig) -> Result<DrivingLog> {
    let cameras = match config.camera {
        CameraChoice::Front => CameraUse::Front,
        CameraChoice::All => CameraUse::All,
    };
    let max_width = (config.max_width > 0).then_some(config.max_width);
    let log = DrivingLog::open(path, &LogOptions { cameras, max_width })?;
    if log.cameras().is_empty() {
        let wanted = if config.camera == CameraChoice::Front { "a front camera" } else { "a camera" };
        bail!("{}: expected a log with {wanted} (logs.camera), found none", path.display());
    }
    let frames = log.frames().len();
    if frames < MIN_FRAMES {
        bail!("{}: expected a log of at least {MIN_FRAMES} frames, found {frames}", path.display());
    }
    let longest = runs(&times(&log)).iter().map(Range::len).max().unwrap_or(0);
    if longest < MIN_FRAMES {
        bail!("{}: expected {MIN_FRAMES} frames without a gap in the recording, found {longest}", path.display());
    }
    Ok(log)
}

/// Says on stderr what was left out of a log, and what its gaps cost.
pub fn warn(log: &DrivingLog) {
    let path = log.path().to_string_lossy();
    for warning in log.warnings().iter().cloned().chain(gaps(log)) {
        tracing::warn!("{}: {}", printable(&path), printable(&warning));
    }
}

/// Two inputs and a target between them.
pub const MIN_FRAMES: usize = 3;

/// Times of the frames of a log, seconds.
pub fn times(log: &DrivingLog) -> Vec<f64> {
    log.frames().iter().map(|frame| frame.time).collect()
}

/// The cost of the gaps of a recording, in a sentence; `None` without any.
pub fn gaps(log: &DrivingLog) -> Option<String> {
    let runs = runs(&times(log));
    let short: usize = runs.iter().map(Range::len).filter(|frames| *frames < MIN_FRAMES).sum();
    gs_driving::gaps(log.frames()).map(|gaps| {
        let frames = format!("{} {} in none", counted(short, "frame"), agree(short, "is", "are"));
        format!("the recording has {gaps}, over which no snippet reaches; {frames}")
    })
}

/// The snippets of a log whose frames have these times (seconds), by the configuration. None reaches over a gap in the
/// recording. The last one of a run begins earlier where it would reach beyond the run.
pub fn snippets(times: &[f64], config: &LogsConfig) -> Vec<Snippet> {
    let all = snippets_without_gaps(times, config.frames, config.spacing()).into_iter();
    all.filter(|snippet| snippet.frames.len() >= MIN_FRAMES).collect()
}

/// `count` of the places, spread evenly; all with 0.
fn spread(places: &[Place], count: usize) -> Vec<Place> {
    let all = places.len();
    let count = if count == 0 { all } else { count.min(all) };
    (0..count).map(|i| places[i * all / count].clone()).collect()
}

fn find(path: &Path) -> Result<Vec<PathBuf>> {
    if LogFormat::of(path).is_some() {
        return Ok(vec![path.to_path_buf()]);
    }
    if !path.is_dir() {
        bail!("{}: expected a driving log or a folder of driving logs, found no folder", path.display());
    }
    let found = logs_in(path)?;
    if found.is_empty() {
        bail!(
            "{}: expected a driving log or a folder of driving logs (PandaSet, Argoverse 2 or Waymo), found none",
            path.display()
        );
    }
    Ok(found)
}

fn held_out(path: &Path, logs: &[DrivingLog], config: &LogsConfig) -> Result<Vec<bool>> {
    let names = &config.validation;
    if names.is_empty() {
        return match config.split {
            SplitChoice::LastEighth => {
                let count = if logs.len() > 1 { logs.len().div_ceil(ONE_IN) } else { 0 };
                Ok((0..logs.len()).map(|index| index + count >= logs.len()).collect())
            }
            SplitChoice::Paper => of_paper(path, logs),
        };
    }
    if let Some(missing) = names.iter().find(|name| !logs.iter().any(|log| log.name() == name.as_str())) {
        let known: Vec<String> = logs.iter().map(|log| log.name().to_string()).collect();
        let known = some_names(&known);
        bail!("{}: expected a log of logs.validation, found {missing:?}; the logs are {known}", path.display());
    }
    Ok(logs.iter().map(|log| names.iter().any(|name| name == log.name())).collect())
}

/// The test logs of section C.1; `logs` are sorted by name.
fn of_paper(path: &Path, logs: &[DrivingLog]) -> Result<Vec<bool>> {
    if let Some(log) = logs.iter().find(|log| log.format() == LogFormat::Waymo) {
        bail!(
            "{}: the paper's split of the Waymo Open Dataset is a list of another project (NOTR); name its logs in \
             logs.validation",
            log.path().display()
        );
    }
    let mut argoverse = 0;
    let mut is_test = |log: &DrivingLog| match log.format() {
        LogFormat::Argoverse => {
            argoverse += 1;
            argoverse <= TEST_LOGS_ARGOVERSE
        }
        _ => TEST_LOGS.contains(&log.name()),
    };
    let found: Vec<bool> = logs.iter().map(&mut is_test).collect();
    if !found.contains(&true) {
        let names = TEST_LOGS.join(", ");
        bail!(
            "{}: expected one of the paper's test logs (logs.split = \"paper\"), {names}, found none",
            path.display()
        );
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at_10_hz(frames: usize) -> Vec<f64> {
        (0..frames).map(|frame| 0.1 * frame as f64).collect()
    }

    fn starts(times: &[f64], config: &LogsConfig) -> Vec<usize> {
        snippets(times, config).iter().map(|snippet| snippet.frames[0]).collect()
    }

    #[test]
    fn snippets_cover_the_log() {
        let config = LogsConfig { frames: 11, every: 6, ..LogsConfig::default() };
        assert_eq!(starts(&at_10_hz(11), &config), [0]);
        assert_eq!(starts(&at_10_hz(20), &config), [0, 6, 9]);
        assert_eq!(starts(&at_10_hz(3), &config), [0]);
        assert_eq!(snippets(&at_10_hz(3), &config)[0].inputs, [0, 2]);
    }

    /// C.2: neighbours share five frames, whatever the length of a snippet.
    #[test]
    fn neighbours_share_five_frames() {
        let of = |frames: usize| LogsConfig { frames, ..LogsConfig::default() };
        assert_eq!(starts(&at_10_hz(23), &of(11)), [0, 6, 12]);
        assert_eq!(starts(&at_10_hz(38), &of(16)), [0, 11, 22]);
        assert_eq!(starts(&at_10_hz(5), &of(3)), [0, 1, 2]);
    }

    /// A second is missing behind frame 12, and runs of one and two frames have no target between inputs.
    #[test]
    fn no_snippet_reaches_over_a_gap() {
        let mut times = at_10_hz(30);
        times[13..].iter_mut().for_each(|time| *time += 1.0);
        times[28..].iter_mut().for_each(|time| *time += 1.0);
        let list = snippets(&times, &LogsConfig::default());
        let runs = [0..13, 13..28];
        let in_one = |snippet: &Snippet| runs.iter().any(|run| snippet.frames.iter().all(|frame| run.contains(frame)));
        assert!(list.iter().all(in_one), "{list:?}");
        assert_eq!(starts(&times, &LogsConfig::default()), [0, 2, 13, 17]);
    }
}
