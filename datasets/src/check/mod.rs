//! [`check`]: what is in a data set, what is missing and what is wrong, without needing it to load.

mod geometry;
mod report;

use std::path::Path;

use rayon::prelude::*;

use crate::error::DatasetError;
use crate::formats::{self, Layout, colmap, transforms};
use crate::frame::Intrinsics;
use crate::loader;
use crate::mask::{self, Mask};
use crate::options::LoadOptions;
use crate::raw::{Findings, RawFrame, RawScene, some_names};
use crate::resize::target_size;
use crate::split::split;
use crate::{pixels, scene};

pub use self::report::CheckReport;

/// Examines a data set: reads its description, decodes every image and mask, and measures the cameras' geometry. Goes on
/// after errors, so that the report lists all of them. With a COLMAP model the reprojection error is recomputed.
pub fn check(path: &Path, options: &LoadOptions) -> CheckReport {
    let mut report = CheckReport { path: path.to_path_buf(), ..CheckReport::default() };
    let mut findings = Findings { lenient: true, ..Findings::default() };
    if let Err(error) =
        loader::check_options(path, options).and_then(|()| fill(&mut report, path, options, &mut findings))
    {
        findings.errors.push(error);
    }
    report.warnings = findings.warnings;
    report.errors.extend(findings.errors.iter().map(ToString::to_string));
    report
}

fn fill(
    report: &mut CheckReport,
    path: &Path,
    options: &LoadOptions,
    findings: &mut Findings,
) -> Result<(), DatasetError> {
    let raw = match formats::detect(path)? {
        Layout::Transforms(sources) => {
            let files: Vec<String> = sources.files.iter().map(|(file, _)| file.display().to_string()).collect();
            report.facts.push(format!("The description is in {}.", files.join(", ")));
            transforms::read(&sources, options, findings)?
        }
        Layout::Colmap(files) => {
            report.facts.push(format!("The model is in {}.", files.folder.display()));
            let model = colmap::read_model(&files, true, findings)?;
            report.facts.push(geometry::describe_model(&model));
            if let Some(reprojection) = geometry::reprojection(&model, &files.file("cameras")) {
                report.facts.push(reprojection.to_string());
                report.reprojection_median = Some(reprojection.median);
            }
            colmap::scene(&files, model, options, findings)?
        }
    };
    report.format = Some(raw.format);
    let RawScene { frames, points, .. } = raw;
    let frames = loader::sort_and_name(frames, findings);
    report.points = points.as_ref().map_or(0, |points| points.positions.len());
    report.facts.push(geometry::describe_points(points.as_ref()));
    if frames.is_empty() {
        let found = "no frame that can be used".to_string();
        return Err(DatasetError::NoFrames { path: path.to_path_buf(), found });
    }
    report.facts.push(format!("Frames with an image: {}.", frames.len()));
    describe_images(&frames, options, report, findings);
    report.facts.push(geometry::describe_cameras(&frames));
    let origin = loader::origin(&frames, options);
    if origin != glam::DVec3::ZERO {
        report.facts.push(format!("The scene is far from its world's origin and will be moved by {:.1}.", -origin));
    }
    describe_times(&frames, report);
    let split = split(frames, &options.holdout, path)?;
    (report.train, report.test) = (split.train.len(), split.test.len());
    report.facts.push(format!("{} views train, {} are held out: {}.", report.train, report.test, split.rule));
    let centres: Vec<glam::DVec3> = split.train.iter().map(|frame| frame.c2w.w_axis.truncate()).collect();
    if let Some(mean) = scene::mean(&centres)
        && centres.len() > 1
        && centres.iter().all(|centre| centre.distance(mean) < 1e-9)
    {
        findings.warn("all training cameras stand in one place; depth cannot be learned from them");
    }
    Ok(())
}

/// What decoding one frame's files gave.
struct Decoded {
    size: (usize, usize),
    intrinsics: Intrinsics,
    rescaled: bool,
    /// Share of the image that masks ignore; `None` without masks.
    masked: Option<f64>,
}

fn decode(frame: &RawFrame) -> Result<Decoded, DatasetError> {
    let image = pixels::decode(&frame.image_path)?;
    let size = (image.width() as usize, image.height() as usize);
    let resolved = frame.lens.resolve((image.width(), image.height()), &frame.image_path, &frame.file)?;
    let masks: Vec<Mask> = frame.masks.iter().map(|file| Mask::open(file, size)).collect::<Result<_, _>>()?;
    let masked = (!masks.is_empty()).then(|| mask::ignored_share(&masks, size));
    Ok(Decoded { size, intrinsics: resolved.intrinsics, rescaled: resolved.rescaled_from.is_some(), masked })
}

fn describe_images(frames: &[RawFrame], options: &LoadOptions, report: &mut CheckReport, findings: &mut Findings) {
    let results: Vec<Result<Decoded, DatasetError>> = frames.par_iter().map(decode).collect();
    let mut decoded = Vec::new();
    for result in results {
        match result {
            Ok(value) => decoded.push(value),
            Err(error) => findings.errors.push(error),
        }
    }
    let mut sizes: Vec<((usize, usize), usize)> = Vec::new();
    for Decoded { size, .. } in &decoded {
        match sizes.iter_mut().find(|(known, _)| known == size) {
            Some((_, count)) => *count += 1,
            None => sizes.push((*size, 1)),
        }
    }
    for ((width, height), count) in sizes.iter().take(5) {
        let (w, h) = target_size((*width, *height), options.max_width);
        let loaded = if (w, h) == (*width, *height) { String::new() } else { format!(", loaded at {w} x {h}") };
        report.facts.push(format!("{count} images are {width} x {height} pixels{loaded}."));
    }
    if sizes.len() > 5 {
        report.facts.push(format!("There are {} more image sizes.", sizes.len() - 5));
    }
    let rescaled = decoded.iter().filter(|value| value.rescaled).count();
    if rescaled > 0 {
        findings.warn(format!("the intrinsics of {rescaled} views are for another size and will be rescaled"));
    }
    let across = |focal: fn(&Decoded) -> f64| {
        let low = decoded.iter().map(focal).fold(f64::INFINITY, f64::min);
        (low, decoded.iter().map(focal).fold(0.0, f64::max))
    };
    if !decoded.is_empty() {
        let (x, y) = (across(|value| value.intrinsics.fx), across(|value| value.intrinsics.fy));
        let angle = across(|value| 2.0 * (0.5 * value.size.0 as f64 / value.intrinsics.fx).atan().to_degrees());
        report.facts.push(format!(
            "Focal lengths are {} by {} pixels; the horizontal angle of view is {} degrees.",
            range(x),
            range(y),
            range(angle)
        ));
    }
    let distorted = frames.iter().filter(|frame| !frame.lens.distortion.is_none()).count();
    report.facts.push(match distorted {
        0 => "No lens distortion is declared.".to_string(),
        _ => format!("{distorted} images have a lens distortion, which is removed at load."),
    });
    let masked = frames.iter().filter(|frame| !frame.masks.is_empty()).count();
    if masked > 0 {
        report.facts.push(format!("{masked} images have masks."));
    }
    let shares = decoded.iter().filter_map(|value| value.masked).collect();
    findings.warnings.extend(mask::suspicion(&report.path, shares));
}

fn describe_times(frames: &[RawFrame], report: &mut CheckReport) {
    let times: Vec<f64> = frames.iter().filter_map(|frame| frame.time).collect();
    if times.is_empty() {
        return;
    }
    let low = times.iter().copied().fold(f64::INFINITY, f64::min);
    let high = times.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let mut sorted = times.clone();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    let mut cameras: Vec<&str> = frames.iter().filter_map(|frame| frame.camera_id.as_deref()).collect();
    cameras.sort_unstable();
    cameras.dedup();
    let by = if cameras.is_empty() {
        String::new()
    } else {
        format!(" by {} cameras ({})", cameras.len(), some_names(&cameras))
    };
    report.facts.push(format!(
        "{} views have a time, {} different ones from {low} to {high}{by}.",
        times.len(),
        sorted.len()
    ));
}

/// "1375.52" or "1370.00 to 1380.00".
fn range((low, high): (f64, f64)) -> String {
    if high - low < 0.005 { format!("{low:.2}") } else { format!("{low:.2} to {high:.2}") }
}
