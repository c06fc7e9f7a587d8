//! [`check`]: a report on the contents and mistakes of a driving log, also of one that does not open.

use std::f64::consts::TAU;
use std::fmt;
use std::path::{Path, PathBuf};

use glam::DVec3;
use gs_base::statistics::range;
use gs_base::{agree, clause, counted, median, printable};
use gs_datasets::{DatasetError, FrameSource, write_findings};
use rayon::prelude::*;

use crate::draw;
use crate::faults::sentences;
use crate::log::{DrivingLog, LogFormat};
use crate::options::LogOptions;
use crate::pandaset;
use crate::project::project;
use crate::snippet::gaps;
use crate::sweep::Sweep;

/// Contents and mistakes of a driving log. `Display` prints it whole, one sentence a line.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DrivingReport {
    /// The folder.
    pub path: PathBuf,
    /// The layout; `None` if none was recognised.
    pub format: Option<LogFormat>,
    /// Contents, in sentences.
    pub facts: Vec<String>,
    /// Omissions and suspicions, in sentences.
    pub warnings: Vec<String>,
    /// Mistakes that keep the log from being used, in sentences.
    pub errors: Vec<String>,
}

impl DrivingReport {
    /// Whether the log can be used.
    pub fn is_ok(&self) -> bool {
        self.errors.is_empty()
    }
}

impl fmt::Display for DrivingReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.format.map_or("not recognised", LogFormat::name);
        writeln!(f, "{}: {name}", printable(&self.path.to_string_lossy()))?;
        write_findings(f, &self.facts, &self.warnings, &self.errors)
    }
}

/// Facts about one sweep.
struct SweepNote {
    points: usize,
    left_out: usize,
    /// Share of points in any image of the frame; `None` without images.
    seen: Option<f64>,
    /// Points of the first sensor and of all others.
    by_sensor: [usize; 2],
    /// First and last time of a point, seconds after the time of the frame.
    span: Option<(f64, f64)>,
    /// How much later the other LiDARs see a direction than the first, seconds.
    skew: Option<f64>,
    objects: Option<usize>,
}

/// Examines a log: reads every sweep and decodes every image. With `pictures`, the sweep of the middle frame is drawn
/// into the images of that frame, coloured by depth, and each is written there as `CAMERA-FRAME.png`; edges of colour
/// and edges of depth agree if times and calibration are right. At most one sweep and one image a thread are held at a
/// time.
pub fn check(path: &Path, options: &LogOptions, pictures: Option<&Path>) -> DrivingReport {
    let mut report =
        DrivingReport { path: path.to_path_buf(), format: LogFormat::of(path), ..DrivingReport::default() };
    let log = match DrivingLog::open(path, options) {
        Ok(log) => log,
        Err(error) => {
            report.errors.push(error.to_string());
            return report;
        }
    };
    report.warnings.extend(log.warnings().iter().map(|warning| printable(warning).into_owned()));
    describe_frames(&log, &mut report);
    describe_cameras(&log, &mut report);
    describe_rig(&log, &mut report);
    describe_sweeps(&log, &mut report);
    let broken: Vec<DatasetError> =
        (0..FrameSource::frames(&log).len()).into_par_iter().filter_map(|index| log.decode(index).err()).collect();
    report.errors.extend(sentences(&broken));
    if let Some(folder) = pictures
        && let Err(error) = draw_middle(&log, folder, &mut report)
    {
        report.errors.push(error.to_string());
    }
    report
}

fn describe_frames(log: &DrivingLog, report: &mut DrivingReport) {
    let frames = log.frames();
    let span = frames.last().map_or(0.0, |last| last.time - frames[0].time);
    let way: f64 = frames.windows(2).map(|pair| pair[1].ego.w_axis.distance(pair[0].ego.w_axis)).sum();
    let usual = median(frames.windows(2).map(|pair| pair[1].time - pair[0].time).collect());
    let interval = usual.map_or(String::new(), |usual| format!(", one every {:.0} ms", 1e3 * usual));
    report.facts.push(format!(
        "{} over {span:.1} s{interval}; the ego vehicle drives {way:.1} m.",
        counted(frames.len(), "frame")
    ));
    if let Some(gaps) = gaps(frames) {
        report.warnings.push(format!("the recording has {gaps}, over which no snippet and no motion reaches"));
    }
    if log.origin().length() > 0.0 {
        report
            .facts
            .push(format!("Positions are moved by {:.1} m, to the ego vehicle at the first frame.", -log.origin()));
    }
}

fn describe_cameras(log: &DrivingLog, report: &mut DrivingReport) {
    if log.cameras().is_empty() {
        report.warnings.push("no camera has an image; points have no colours".to_string());
    }
    for (index, camera) in log.cameras().iter().enumerate() {
        let frames = 0..log.frames().len();
        let skews: Vec<f64> = frames
            .filter(|frame| log.view_index(*frame, index).is_some())
            .filter_map(|frame| Some(1e3 * (log.shot(frame, index)?.time - log.frames()[frame].time)))
            .collect();
        let (low, high) = bounds(skews.iter().copied());
        report.facts.push(format!(
            "{}: {} of {} x {} pixels, focal length {:.0}, taken {low:.1} to {high:.1} ms after the time of the sweep.",
            camera.name,
            counted(skews.len(), "image"),
            camera.width,
            camera.height,
            camera.intrinsics.fx
        ));
        const SKEW_MAX: f64 = 100.0;
        if low.abs().max(high.abs()) > SKEW_MAX {
            report
                .warnings
                .push(format!("{} and the sweeps differ by more than {SKEW_MAX} ms, one turn of a LiDAR", camera.name));
        }
    }
}

/// The cameras of the data set's rig that a log was written or downloaded without.
fn describe_rig(log: &DrivingLog, report: &mut DrivingReport) {
    let is_absent = |name: &&str| !pandaset::names::has_camera(log.path(), name);
    let absent: Vec<&str> = match log.format() {
        LogFormat::PandaSet => pandaset::names::CAMERAS.iter().map(|(name, _)| *name).filter(is_absent).collect(),
        _ => Vec::new(),
    };
    if !absent.is_empty() {
        let (count, rig) = (counted(absent.len(), "camera"), pandaset::names::CAMERAS.len());
        report.facts.push(format!(
            "{count} of the rig's {rig} {} not here: {}.",
            agree(absent.len(), "is", "are"),
            absent.join(", ")
        ));
    }
}

fn describe_sweeps(log: &DrivingLog, report: &mut DrivingReport) {
    let with: Vec<usize> = (0..log.frames().len()).filter(|frame| log.frames()[*frame].has_sweep).collect();
    let notes: Vec<Result<SweepNote, DatasetError>> =
        with.par_iter().map(|frame| note(log, *frame, &log.sweep(*frame)?)).collect();
    let (mut good, mut broken) = (Vec::new(), Vec::new());
    for note in notes {
        match note {
            Ok(note) => good.push(note),
            Err(error) => broken.push(error),
        }
    }
    report.errors.extend(sentences(&broken));
    let (low, high) = bounds(good.iter().map(|note| note.points as f64));
    let sensors = [0, 1].map(|sensor| good.iter().map(|note| note.by_sensor[sensor]).sum::<usize>());
    let share = sensors[1] as f64 / (sensors[0] + sensors[1]).max(1) as f64;
    report.facts.push(format!(
        "{} of {low:.0} to {high:.0} points; {:.0} % are not of the first LiDAR.",
        counted(good.len(), "sweep"),
        100.0 * share
    ));
    if let Some((first, last)) = range(good.iter().filter_map(|note| note.span).flat_map(<[f64; 2]>::from)) {
        report.facts.push(format!(
            "Points are taken {:.0} to {:.0} ms after the time of their sweep.",
            1e3 * first,
            1e3 * last
        ));
    }
    if let Some((least, most)) = range(good.iter().filter_map(|note| note.skew)) {
        let (least, most) = (1e3 * least, 1e3 * most);
        report.facts.push(format!("Other LiDARs see a direction {least:.0} to {most:.0} ms after the first does."));
    }
    let objects: Vec<f64> = good.iter().filter_map(|note| note.objects.map(|count| count as f64)).collect();
    report.facts.push(match range(objects.iter().copied()) {
        None => "No sweep is labelled.".to_string(),
        Some((few, many)) => {
            format!("{} labelled, with {few:.0} to {many:.0} objects.", counted(objects.len(), "sweep"))
        }
    });
    let left_out: usize = good.iter().map(|note| note.left_out).sum();
    if left_out > 0 {
        report
            .warnings
            .push(format!("{} not finite or too far away and left out", clause(left_out, "point", "is", "are")));
    }
    let empty = good.iter().filter(|note| note.points == 0).count();
    if empty > 0 {
        report.warnings.push(format!("{} without a point", clause(empty, "sweep", "is", "are")));
    }
    if let Some((low, high)) = range(good.iter().filter_map(|note| note.seen)) {
        report.facts.push(format!(
            "{:.0} to {:.0} % of the points of a sweep are in an image of its frame.",
            100.0 * low,
            100.0 * high
        ));
        if high == 0.0 {
            report
                .errors
                .push("no LiDAR point falls into any image: the calibration or the poses are wrong".to_string());
        }
    }
}

fn note(log: &DrivingLog, frame: usize, sweep: &Sweep) -> Result<SweepNote, DatasetError> {
    let views: Vec<_> = (0..log.cameras().len())
        .filter(|camera| log.view_index(frame, *camera).is_some())
        .filter_map(|camera| Some((&log.cameras()[camera], log.camera_pose(frame, camera)?.inverse())))
        .collect();
    let is_seen = |point: &&[f32; 3]| views.iter().any(|(camera, w2c)| project(camera, w2c, **point).is_some());
    let seen = sweep.points.iter().filter(is_seen).count() as f64 / sweep.len().max(1) as f64;
    let time = log.frames()[frame].time;
    let mut tracks: Vec<String> = log.cuboids(frame)?.into_iter().map(|cuboid| cuboid.track).collect();
    tracks.sort_unstable();
    tracks.dedup();
    Ok(SweepNote {
        points: sweep.len(),
        left_out: sweep.left_out,
        seen: (!views.is_empty()).then_some(seen),
        by_sensor: [true, false].map(|first| sweep.sensor.iter().filter(|sensor| (**sensor == 0) == first).count()),
        span: range(sweep.times.iter().map(|t| t - time)),
        skew: skew(sweep, log.lidar_position(frame, 0)),
        objects: (!tracks.is_empty()).then_some(tracks.len()),
    })
}

/// How much later the other LiDARs see a direction than the first, seconds: the median over their points.
fn skew(sweep: &Sweep, centre: DVec3) -> Option<f64> {
    // A LiDAR that turns ten times a second takes 0.8 ms for one of these.
    const DIRECTIONS: usize = 120;
    let direction = |point: &[f32; 3]| {
        let (x, y) = (f64::from(point[0]) - centre.x, f64::from(point[1]) - centre.y);
        ((y.atan2(x) / TAU).rem_euclid(1.0) * DIRECTIONS as f64) as usize % DIRECTIONS
    };
    let mut first: Vec<Option<f64>> = vec![None; DIRECTIONS];
    let points = || sweep.points.iter().zip(&sweep.times).zip(&sweep.sensor);
    points().filter(|(_, sensor)| **sensor == 0).for_each(|((point, time), _)| first[direction(point)] = Some(*time));
    let others = points().filter(|(_, sensor)| **sensor != 0);
    median(others.filter_map(|((point, time), _)| Some(time - first[direction(point)]?)).collect())
}

/// Least and greatest value; zeros of an empty list.
fn bounds(values: impl Iterator<Item = f64>) -> (f64, f64) {
    range(values).unwrap_or_default()
}

fn draw_middle(log: &DrivingLog, folder: &Path, report: &mut DrivingReport) -> Result<(), DatasetError> {
    let cameras =
        |frame: usize| (0..log.cameras().len()).filter(move |camera| log.view_index(frame, *camera).is_some());
    let frames = (0..log.frames().len()).filter(|frame| log.frames()[*frame].has_sweep);
    let complete: Vec<usize> = frames.filter(|frame| cameras(*frame).next().is_some()).collect();
    let Some(frame) = complete.get(complete.len() / 2) else {
        report.warnings.push("no frame has a sweep and an image; nothing is drawn".to_string());
        return Ok(());
    };
    let sweep = log.sweep(*frame)?;
    let mut drawn = 0;
    for camera in cameras(*frame) {
        let file = format!("{}-{}.png", log.cameras()[camera].name, log.frames()[*frame].name);
        draw::overlay(log, *frame, camera, &sweep, &folder.join(file))?;
        drawn += 1;
    }
    report.facts.push(format!(
        "The sweep of frame {} is drawn into {} in {}.",
        log.frames()[*frame].name,
        counted(drawn, "image"),
        printable(&folder.to_string_lossy())
    ));
    Ok(())
}
