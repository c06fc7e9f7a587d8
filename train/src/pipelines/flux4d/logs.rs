//! The logs of a folder, which of them train, and their snippets.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use gs_datasets::some_names;
use gs_driving::{CameraUse, DrivingLog, LogFormat, LogOptions, Snippet};

use super::config::{CameraChoice, LogsConfig};
use crate::run::fingerprint::Fingerprint;

/// Of this many logs one is held out where the configuration names none.
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
    /// By name.
    pub logs: Vec<DrivingLog>,
    /// Snippets to train on.
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
        let found = find(path)?;
        let logs: Vec<DrivingLog> = found.iter().map(|path| open(path, config)).collect::<Result<_>>()?;
        let is_held_out = held_out(path, &logs, &config.validation)?;
        let (mut train, mut validation) = (Vec::new(), Vec::new());
        for (index, log) in logs.iter().enumerate() {
            let places = snippets(log.frames().len(), config).into_iter();
            let places = places.map(|snippet| Place { log: index, snippet });
            match is_held_out[index] {
                true => validation.extend(spread(places.collect(), config.validation_snippets)),
                false => train.extend(places),
            }
        }
        if train.is_empty() {
            bail!("{}: expected a log to train on, found that all are held out (logs.validation)", path.display());
        }
        let (held_out, split) = match validation.is_empty() {
            true => (spread(train.clone(), config.validation_snippets), "train"),
            false => (validation, "validation"),
        };
        Ok(Self { logs, train, held_out, split })
    }

    /// The fingerprint of the frames that train: names, times and poses.
    pub fn fingerprint(&self) -> Fingerprint {
        let mut hasher = crc32fast::Hasher::new();
        for place in &self.train {
            let log = &self.logs[place.log];
            hasher.update(log.name().as_bytes());
            for frame in place.snippet.frames.iter().map(|frame| &log.frames()[*frame]) {
                hasher.update(&frame.time.to_le_bytes());
                frame.ego.to_cols_array().iter().for_each(|x| hasher.update(&x.to_le_bytes()));
            }
        }
        Fingerprint { views: self.train.len(), crc32: hasher.finalize() }
    }

    /// The name of a snippet: log and first frame.
    pub fn name(&self, place: &Place) -> String {
        format!("{}-{:03}", self.logs[place.log].name(), place.snippet.frames[0])
    }
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
    Ok(log)
}

/// Two inputs and a target between them.
const MIN_FRAMES: usize = 3;

/// The snippets of a log by the configuration. The last one begins earlier where it would reach beyond the log.
pub fn snippets(frames: usize, config: &LogsConfig) -> Vec<Snippet> {
    let count = config.frames.min(frames);
    let mut starts: Vec<usize> = (0..=frames - count).step_by(config.every).collect();
    if config.every < count && starts.last().is_some_and(|last| last + count < frames) {
        starts.push(frames - count);
    }
    starts.into_iter().map(|start| Snippet::new(start, count)).collect()
}

/// `count` of the places, spread evenly; all with 0.
fn spread(places: Vec<Place>, count: usize) -> Vec<Place> {
    let all = places.len();
    if count == 0 || count >= all {
        return places;
    }
    (0..count).map(|i| places[i * all / count].clone()).collect()
}

fn find(path: &Path) -> Result<Vec<PathBuf>> {
    if LogFormat::of(path).is_some() {
        return Ok(vec![path.to_path_buf()]);
    }
    if !path.is_dir() {
        bail!("{}: expected a driving log or a folder of driving logs, found no folder", path.display());
    }
    let entries = fs::read_dir(path).with_context(|| format!("{}: cannot read the folder", path.display()))?;
    let mut found: Vec<PathBuf> =
        entries.flatten().map(|entry| entry.path()).filter(|path| LogFormat::of(path).is_some()).collect();
    found.sort();
    if found.is_empty() {
        bail!(
            "{}: expected a driving log or a folder of driving logs (PandaSet, Argoverse 2 or Waymo), found none",
            path.display()
        );
    }
    Ok(found)
}

fn held_out(path: &Path, logs: &[DrivingLog], names: &[String]) -> Result<Vec<bool>> {
    if names.is_empty() {
        let count = if logs.len() > 1 { logs.len().div_ceil(ONE_IN) } else { 0 };
        return Ok((0..logs.len()).map(|index| index + count >= logs.len()).collect());
    }
    if let Some(missing) = names.iter().find(|name| !logs.iter().any(|log| log.name() == name.as_str())) {
        let known: Vec<String> = logs.iter().map(|log| log.name().to_string()).collect();
        let known = some_names(&known);
        bail!("{}: expected a log of logs.validation, found {missing:?}; the logs are {known}", path.display());
    }
    Ok(logs.iter().map(|log| names.iter().any(|name| name == log.name())).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn snippets_cover_the_log() {
        let config = LogsConfig { frames: 11, every: 6, ..LogsConfig::default() };
        let starts = |frames: usize| snippets(frames, &config).iter().map(|s| s.frames[0]).collect::<Vec<_>>();
        assert_eq!(starts(11), [0]);
        assert_eq!(starts(20), [0, 6, 9]);
        assert_eq!(starts(3), [0]);
        assert_eq!(snippets(3, &config)[0].inputs, [0, 2]);
    }
}
