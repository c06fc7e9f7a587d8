//! [`check`]: a report on the contents and mistakes of a data set, also of one that does not load.

mod geometry;
mod grouping;
mod images;
mod report;

use std::path::Path;

use gs_base::sentence::position;
use gs_base::statistics::range;
use gs_base::{agree, clause, counted, mean, printable};

use crate::consistency;
use crate::description::{Description, check_options};
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::formats::{self, Layout, colmap};
use crate::names::some_names;
use crate::options::LoadOptions;
use crate::raw::{RawFrame, SplitName};
use crate::split;
use crate::subject::subject_distance;

pub use self::grouping::{Common, said_once};
pub use self::report::{CheckReport, write_findings};

/// Examines a data set: reads its description, decodes every image and mask, and measures the cameras' geometry. Goes
/// on after errors, so that the report lists all of them. With a COLMAP model the reprojection error is recomputed.
pub fn check(path: &Path, options: &LoadOptions) -> CheckReport {
    let mut report = CheckReport { path: path.to_path_buf(), ..CheckReport::default() };
    let mut findings = Findings::lenient();
    if let Err(error) = check_options(path, options).and_then(|()| fill(&mut report, path, options, &mut findings)) {
        findings.errors.push(error);
    }
    report.facts = report.facts.iter().map(|fact| printable(fact).into_owned()).collect();
    report.warnings = findings.take_warnings();
    report.errors = grouping::sentences(&findings.errors);
    report
}

fn fill(
    report: &mut CheckReport,
    path: &Path,
    options: &LoadOptions,
    findings: &mut Findings,
) -> Result<(), DatasetError> {
    let layout = formats::detect(path)?;
    report.facts.push(place(&layout));
    let raw = match layout {
        Layout::Colmap(files) => {
            let model = colmap::read_model(&files, true, findings)?;
            report.facts.push(geometry::describe_model(&model));
            if let Some(reprojection) = geometry::reprojection(&model, &files.file("cameras")) {
                report.facts.push(reprojection.to_string());
                report.reprojection_median = Some(reprojection.median);
            }
            colmap::scene(&files, model, options, findings)?
        }
        other => other.read(options, findings)?,
    };
    report.format = Some(raw.format);
    report.facts.append(&mut findings.take_facts());
    let Description { frames, points, decoder, .. } = Description::of(raw, path, options, findings)?;
    report.facts.append(&mut findings.take_facts());
    report.points = points.as_ref().map_or(0, |points| points.positions.len());
    report.facts.push(geometry::describe_points(points.as_ref()));
    if frames.is_empty() && !findings.errors.is_empty() {
        return Ok(());
    }
    if frames.is_empty() {
        let found = "no frame that can be used".to_string();
        return Err(DatasetError::NoFrames { path: path.to_path_buf(), found });
    }
    report.facts.push(format!("Frames with an image: {}.", frames.len()));
    // A split that cannot be made is the last error of the report.
    let plan = split::plan(&frames, options, path);
    let examined: Vec<(&RawFrame, bool)> = match &plan {
        Ok(plan) => frames.iter().enumerate().filter_map(|(i, frame)| Some((frame, plan.trains(i)?))).collect(),
        Err(_) => frames.iter().map(|frame| (frame, SplitName::trains(frame.split.as_ref()))).collect(),
    };
    images::describe(&examined, &decoder, report, findings);
    report.facts.push(geometry::describe_cameras(&frames));
    if decoder.origin != glam::DVec3::ZERO {
        report.facts.push(format!(
            "The scene is {:.0} units from its world's origin. Its files have positions relative to \
             {}, an offset that they name and that is read back.",
            decoder.origin.length(),
            position(decoder.origin, 3)
        ));
    }
    describe_times(&frames, report);
    let plan = plan?;
    let train: Vec<&RawFrame> = plan.train.iter().map(|index| &frames[*index]).collect();
    let held_out: Vec<&RawFrame> = plan.held_out_frames().map(|index| &frames[index]).collect();
    let views = |list: &[usize]| list.iter().map(|index| decoder.views(&frames[*index])).sum();
    report.train = views(&plan.train);
    report.held_out = plan.held_out.iter().map(|(name, list)| (name.clone(), views(list))).collect();
    let training = clause(report.train, "view", "trains", "train");
    let counts = split::counts(report.held_out.iter().map(|(name, count)| (name.as_str(), *count)));
    report.facts.push(match report.views() - report.train {
        0 => format!("{training}, none is held out: {}.", plan.rule),
        count => format!("{training}, {count} {} held out ({counts}): {}.", agree(count, "is", "are"), plan.rule),
    });
    if options.sparse.is_some() && points.is_some() {
        findings.warn_all(split::hidden_points(&frames, &plan, path));
    }
    findings.warn_all(consistency::compare_splits(&train, &held_out, options.expects_later_frames(), path));
    report.timed = train.iter().filter(|frame| frame.time.is_some()).count();
    report.without_time = consistency::without_time(&train, &held_out).len();
    let poses: Vec<glam::DMat4> = train.iter().map(|frame| frame.c2w).collect();
    report.subject_distance = subject_distance(&poses);
    let centres: Vec<glam::DVec3> = train.iter().map(|frame| frame.c2w.w_axis.truncate()).collect();
    if let Some(mean) = mean(&centres)
        && centres.len() > 1
        && centres.iter().all(|centre| centre.distance(mean) < 1e-9)
    {
        findings.warn("all training cameras stand at one position; depth cannot be learned from them");
    }
    Ok(())
}

/// The sentence about the place of the description.
fn place(layout: &Layout) -> String {
    let all = |files: Vec<&Path>| files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>().join(", ");
    match layout {
        Layout::Transforms(sources) => {
            format!("The description is in {}.", all(sources.files.iter().map(|(file, _)| &**file).collect()))
        }
        Layout::Panoptic(files) => {
            format!("The description is in {}.", all(files.files.iter().map(|(file, _)| &**file).collect()))
        }
        Layout::Colmap(files) => format!("The model is in {}.", files.folder.display()),
        Layout::Llff(poses) => format!("The poses are in {}.", poses.path.display()),
        Layout::RealityScan(table) => format!("The cameras are in {}.", table.file.display()),
        Layout::CameraTexts(texts) => format!("The cameras are texts in {}.", texts.folder.join("cameras").display()),
        Layout::Filmed(filmed) => format!("The model of the cameras is in {}.", filmed.files.folder.display()),
        Layout::Nerfies(captured) => format!("The cameras are in {}.", captured.folder.join("camera").display()),
    }
}

fn describe_times(frames: &[RawFrame], report: &mut CheckReport) {
    let times: Vec<f64> = frames.iter().filter_map(|frame| frame.time).collect();
    let Some((low, high)) = range(times.iter().copied()) else { return };
    let mut sorted = times.clone();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    let mut cameras: Vec<&str> = frames.iter().filter_map(|frame| frame.camera_id.as_deref()).collect();
    cameras.sort_unstable();
    cameras.dedup();
    let by = if cameras.is_empty() {
        String::new()
    } else {
        format!(" by {} ({})", counted(cameras.len(), "camera"), some_names(&cameras))
    };
    report.facts.push(format!(
        "{} a time, {} different {} from {low} to {high}{by}.",
        clause(times.len(), "view", "has", "have"),
        sorted.len(),
        agree(sorted.len(), "one", "ones")
    ));
    if let Some((cameras, still)) = consistency::static_cameras(frames) {
        report.facts.push(format!(
            "{still} of {} with several times {} static.",
            counted(cameras, "camera"),
            agree(still, "is", "are")
        ));
    }
    describe_exposure(frames, report);
}

/// How long the shutter is open, also as a share of the frame interval.
fn describe_exposure(frames: &[RawFrame], report: &mut CheckReport) {
    let exposures: Vec<f64> = frames.iter().filter_map(|frame| frame.exposure).collect();
    let Some((low, high)) = range(exposures.iter().copied()) else {
        report.facts.push("No exposure is given.".to_string());
        return;
    };
    let of = |value: f64| consistency::interval_of(frames).map(|interval| value / interval);
    let share = of(high).map_or_else(String::new, |share| format!(", {share:.2} of the frame interval"));
    let value = if high > low { format!("{low} to {high}") } else { high.to_string() };
    report.facts.push(format!("The exposure of {} is {value}{share}.", counted(exposures.len(), "view")));
}
