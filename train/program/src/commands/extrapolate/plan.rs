//! The request of `gsburn extrapolate`, checked: times, cameras and files.

use std::path::PathBuf;

use anyhow::{Result, bail};
use glam::{DMat4, DQuat, DVec3};
use gs_base::median;
use gs_datasets::{CameraPose, Scene, View};

use crate::cli::ExtrapolateArgs;
use crate::report::future::pose_of;
use crate::report::future::strip::Picture;
use gs_train::config::brief;
use gs_train::run::outputs::write_png;

/// Frames at most: `--frames` allows no more.
const FRAMES_MAX: f64 = 10_000.0;

/// Lengths of the recording that the future may last at most: positions of 32 bits are then still right to a thousandth
/// of the way that something goes in one recording.
const RECORDINGS_MAX: f64 = 1000.0;

/// The name of the camera that goes around.
pub const ORBIT: &str = "orbit";

/// Share of a frame by which a last frame may miss `--to`: rounding.
const ROUNDING: f64 = 1e-6;

/// The times of the frames, ascending.
///
/// # Errors
/// A sentence, when they lie where nothing can be predicted, or are too many.
pub fn times(args: &ExtrapolateArgs, [first, end]: [f64; 2], interval: f64, last: f64) -> Result<Vec<f64>> {
    let (from, to) = (args.from.unwrap_or(end), args.to);
    if to <= end {
        bail!("--to: expected a time after {}, the last that was seen, found {}", brief(end), brief(to));
    }
    let most = (end + RECORDINGS_MAX * (end - first).max(interval)).min(last);
    if to > most {
        bail!("--to: expected a time up to {}, as far as motion can be integrated, found {}", brief(most), brief(to));
    }
    if !(first..to).contains(&from) {
        let [first, to, from] = [first, to, from].map(brief);
        bail!("--from: expected a time from {first}, the first that was seen, and before {to}, found {from}");
    }
    let count = match (args.frames, args.fps) {
        (Some(1), _) => return Ok(vec![to]),
        (Some(count), _) => f64::from(count),
        (None, Some(rate)) => ((to - from) * rate + ROUNDING).floor() + 1.0,
        (None, None) => ((to - from) / interval).round().max(1.0) + 1.0,
    };
    if count > FRAMES_MAX {
        bail!(
            "--to: expected at most {FRAMES_MAX} frames, found {} from {from} to {to}; fewer are asked for with --frames",
            brief(count)
        );
    }
    let step = args.fps.map_or((to - from) / (count - 1.0), f64::recip);
    Ok((0..count as usize).map(|k| (from + step * k as f64).min(to)).collect())
}

/// The median time between frames of the training views; 1 for a single one.
pub fn interval(photos: &Scene) -> f64 {
    let mut times: Vec<f64> = photos.train.iter().filter_map(|view| view.time).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    median(times.windows(2).map(|pair| pair[1] - pair[0]).collect()).unwrap_or(1.0)
}

/// A camera for the frames: its poses are one, or one for each frame.
#[derive(Debug, Clone)]
pub struct Shot {
    /// Its name in files.
    pub name: String,
    /// The pose of each frame; the last is that of all frames after it.
    pub poses: Vec<CameraPose>,
}

impl Shot {
    /// The pose of a frame.
    pub fn pose(&self, frame: usize) -> &CameraPose {
        &self.poses[frame.min(self.poses.len() - 1)]
    }
}

/// The cameras by their names; without any, the first that is held out, or else the first.
///
/// # Errors
/// A sentence with the cameras there are, when one is not known.
pub fn shots(names: &[String], photos: &Scene, middle: DVec3, frames: usize) -> Result<Vec<Shot>> {
    let views: Vec<&View> = photos.held_out_views().chain(&photos.train).collect();
    let Some(first) = views.first() else { bail!("expected a data set with cameras, found none") };
    let still = |view: &View| Shot { name: file_name(&pose_of(view).name), poses: vec![pose_of(view)] };
    if names.is_empty() {
        return Ok(vec![still(first)]);
    }
    let mut shots: Vec<Shot> = Vec::new();
    for name in names {
        let found = views.iter().find(|view| view.camera_id.as_deref() == Some(name) || view.name == *name);
        let shot = match (found, name.as_str()) {
            (Some(view), _) => still(view),
            (None, ORBIT) => orbit(&pose_of(first), photos, middle, frames),
            (None, _) => {
                let mut known: Vec<String> = views.iter().map(|view| pose_of(view).name).collect();
                known.sort();
                known.dedup();
                bail!("--camera: expected {ORBIT} or one of {}; found {name:?}", known.join(", "));
            }
        };
        if shots.iter().any(|other| other.name == shot.name) {
            bail!("--camera: expected each camera once, found {name:?} again");
        }
        shots.push(shot);
    }
    Ok(shots)
}

/// One turn of a camera about `middle` over the frames, around the mean upward direction of all training cameras.
fn orbit(camera: &CameraPose, photos: &Scene, middle: DVec3, frames: usize) -> Shot {
    // The camera's y axis points down.
    let up = photos.train.iter().map(|view| -view.c2w.y_axis.truncate()).sum::<DVec3>();
    let up = up.try_normalize().unwrap_or(DVec3::Z);
    let pose = |frame: usize| {
        let angle = std::f64::consts::TAU * frame as f64 / frames.max(1) as f64;
        let turn = DMat4::from_translation(middle)
            * DMat4::from_quat(DQuat::from_axis_angle(up, angle))
            * DMat4::from_translation(-middle);
        CameraPose { name: ORBIT.into(), c2w: turn * camera.c2w, ..camera.clone() }
    };
    Shot { name: ORBIT.into(), poses: (0..frames.max(1)).map(pose).collect() }
}

/// A name that can stand in the name of a file.
pub fn file_name(name: &str) -> String {
    name.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' }).collect()
}

/// The folder of the results.
///
/// # Errors
/// A sentence, when a checkpoint is given without a folder.
pub fn folder(args: &ExtrapolateArgs) -> Result<PathBuf> {
    match &args.out {
        Some(folder) => Ok(folder.clone()),
        None if args.run.is_dir() => Ok(args.run.join("extrapolate")),
        None => bail!(
            "{}: expected a run folder, found a file; name a folder for the results with --out",
            args.run.display()
        ),
    }
}

/// The files of the results in a folder.
#[derive(Debug, Clone)]
pub struct Files {
    root: PathBuf,
}

impl Files {
    /// The files in `root`.
    pub fn new(root: PathBuf) -> Self {
        Self { root }
    }

    /// A file by its name.
    pub fn at(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    /// Writes a picture that a later call may write over.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn picture(&self, name: &str, picture: &Picture) -> Result<()> {
        write_png(&self.at(name), [picture.width, picture.height], &picture.pixels)
    }

    /// A frame of a camera.
    pub fn frame(&self, shot: &Shot, index: usize) -> PathBuf {
        self.root.join("frames").join(format!("{}_{index:04}.png", shot.name))
    }

    /// The animation of a camera.
    pub fn animation(&self, shot: &Shot) -> PathBuf {
        self.root.join("frames").join(format!("{}.gif", shot.name))
    }

    /// The Gaussians at a time.
    pub fn ply(&self, run: &str, time: f64) -> PathBuf {
        self.root.join("ply").join(format!("{}_{time:.6}.ply", file_name(run)))
    }

    /// A part of the scene.
    pub fn part(&self, name: &str) -> PathBuf {
        self.root.join("bodies").join(format!("{name}.ply"))
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::cli::{Cli, Command};

    fn args(more: &str) -> ExtrapolateArgs {
        let words = "gsburn extrapolate run ".to_string() + more;
        match Cli::try_parse_from(words.split_whitespace()).expect("arguments").command {
            Command::Extrapolate(args) => *args,
            _ => panic!("another command"),
        }
    }

    fn planned(more: &str) -> Result<Vec<f64>, String> {
        times(&args(more), [0.0, 0.75], 0.05, 500.0).map_err(|error| error.to_string())
    }

    #[test]
    fn times_begin_at_the_last_seen_and_end_where_asked() {
        let found = planned("--to 1.0").expect("times");
        assert_eq!((found.len(), found[0], found[5]), (6, 0.75, 1.0));
        assert_eq!(planned("--to 1.5 --frames 4 --from 0").expect("times"), [0.0, 0.5, 1.0, 1.5]);
        assert_eq!(planned("--to 1.5 --frames 1").expect("times"), [1.5]);
        let found = planned("--to 1.0 --fps 10").expect("times");
        assert_eq!(found.len(), 3, "{found:?}");
    }

    #[test]
    fn times_that_cannot_be_predicted_are_refused() {
        for (more, said) in [
            ("--to 0.75", "after 0.75, the last that was seen, found 0.75"),
            ("--to -3", "after 0.75"),
            ("--to 501", "expected a time up to 500"),
            ("--to 1e300", "expected a time up to 500"),
            ("--to 1 --from 1", "before 1, found 1"),
            ("--to 1 --from -0.1", "expected a time from 0"),
            ("--to 400 --fps 1000", "at most 10000 frames"),
        ] {
            let error = planned(more).expect_err("refused");
            assert!(error.contains(said), "{more}: {error}");
        }
        for more in [
            "--to nan",
            "--to inf",
            "--to 1 --frames 0",
            "--to 1 --fps 0",
            "--to 1 --step -1",
            "--to 1 --frames 2 --fps 2",
        ] {
            let words = "gsburn extrapolate run ".to_string() + more;
            assert!(Cli::try_parse_from(words.split_whitespace()).is_err(), "{more}");
        }
    }
}
