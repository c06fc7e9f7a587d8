//! A data set described: its frames sorted, named and made consistent, with no image decoded. [`Log`](crate::Log),
//! [`load`](crate::load) and [`check`](crate::check) begin with it.

use std::path::Path;

use glam::DVec3;
use gs_base::local::RECENTRE_DISTANCE;
use gs_base::{clause, mean};

use crate::behind::Behind;
use crate::consistency;
use crate::convention::{self, PoseConvention};
use crate::decode::Decoder;
use crate::error::DatasetError;
use crate::findings::Findings;
use crate::formats::masks;
use crate::names::{self, some_names};
use crate::options::LoadOptions;
use crate::pose;
use crate::raw::{RawFrame, RawPoints, RawScene};
use crate::scene::{PointCloud, SceneFormat};
use crate::subject::without_strays;

/// Frames sorted by name, before they are split.
pub(crate) struct Description {
    pub format: SceneFormat,
    pub frames: Vec<RawFrame>,
    /// In the file's world.
    pub points: Option<RawPoints>,
    pub decoder: Decoder,
}

impl Description {
    /// The description of a scene that a reader found.
    ///
    /// # Errors
    /// When two views with different poses share a photo.
    pub fn of(
        raw: RawScene,
        path: &Path,
        options: &LoadOptions,
        findings: &mut Findings,
    ) -> Result<Self, DatasetError> {
        findings.take(consistency::one_view_a_photo(&raw.frames, path))?;
        let raw = reread(raw, options, findings)?;
        let mut frames = sort_and_name(raw.frames, findings);
        if let Some(fps) = options.fps {
            timed_by_names(&mut frames, fps, path, findings);
        }
        masks::find(&mut frames, path, raw.format, options, findings);
        let frames = consistency::settle(frames, path, options, findings);
        // In a set with exposures, alpha is a share of light, in its sharp photos too.
        let is_light = frames.iter().any(|frame| frame.exposure.is_some_and(|exposure| exposure > 0.0));
        let behind = Behind { color: options.background, is_light, levels: options.levels };
        let decoder = Decoder::new(options, behind, origin(&frames, options));
        Ok(Self { format: raw.format, frames, points: raw.points, decoder })
    }

    /// The points in the world of views; `None` where there are none.
    pub fn point_cloud(&self) -> Option<PointCloud> {
        let points = self.points.as_ref().filter(|points| !points.positions.is_empty())?;
        let origin = self.decoder.origin;
        let local = points.positions.iter().map(|position| (*position - origin).as_vec3());
        // A scale may take a point beyond what 32 bits hold.
        let finite = local.zip(&points.colors).filter(|(position, _)| position.is_finite());
        let (positions, colors) = finite.map(|(position, color)| (position.to_array(), *color)).unzip();
        Some(PointCloud { positions, colors })
    }
}

pub(crate) fn check_options(path: &Path, options: &LoadOptions) -> Result<(), DatasetError> {
    let wrong = |option: &'static str, expected: &str, found: String| {
        Err(DatasetError::Option { path: path.to_path_buf(), option, expected: expected.to_string(), found })
    };
    if options.max_width == Some(0) {
        return wrong("max_width", "a width of at least 1 pixel", "0".to_string());
    }
    if let Some(exposure) = options.exposure
        && !(exposure > 0.0 && exposure.is_finite())
    {
        return wrong("exposure", "a duration above 0, in the unit of time", exposure.to_string());
    }
    if let Some(fps) = options.fps
        && !(fps > 0.0 && fps.is_finite())
    {
        return wrong("fps", "frames a second above 0", fps.to_string());
    }
    if !(options.points_scale > 0.0 && options.points_scale.is_finite()) {
        return wrong("points_scale", "a factor above 0", options.points_scale.to_string());
    }
    if let Some([black, white]) = options.levels
        && !((0.0..1.0).contains(&black) && white > black && white.is_finite())
    {
        return wrong(
            "levels",
            "two shares of the full range, 0 <= black < 1 and black < white",
            format!("{black} and {white}"),
        );
    }
    if options.background.iter().any(|value| !(0.0..=1.0).contains(value)) {
        return wrong("background", "values from 0 to 1", format!("{:?}", options.background));
    }
    Ok(())
}

/// The scene with its poses and points as the user says that they are meant, in a world of our hand.
fn reread(mut raw: RawScene, options: &LoadOptions, findings: &mut Findings) -> Result<RawScene, DatasetError> {
    let own = PoseConvention::of(raw.format);
    let meant = options.poses.unwrap_or(own);
    let mirrors = |frame: &RawFrame| meant.mirrors(own.to_file(frame.c2w));
    let count = raw.frames.iter().filter(|frame| mirrors(frame)).count();
    // Of one file, all frames are of one hand.
    let is_mirrored = 2 * count > raw.frames.len();
    let (frames, others): (Vec<RawFrame>, Vec<RawFrame>) =
        raw.frames.into_iter().partition(|frame| mirrors(frame) == is_mirrored);
    raw.frames = frames;
    for frame in others {
        findings.take_posed::<()>(Err(pose::reflection(&frame.file, &frame.image_path.display().to_string())))?;
    }
    findings.settle_poses(raw.frames.len())?;
    if is_mirrored {
        let file = raw.frames[0].file.display();
        findings.warn(format!("{file}: the poses are of a mirrored (left-handed) world, whose x axis is negated here"));
    }
    if options.poses.is_some() || is_mirrored {
        raw.frames.iter_mut().for_each(|frame| frame.c2w = meant.to_c2w(own.to_file(frame.c2w)));
    }
    for position in raw.points.iter_mut().flat_map(|points| &mut points.positions) {
        *position *= options.points_scale;
        if is_mirrored {
            *position = convention::mirrored(*position);
        }
    }
    Ok(raw)
}

/// Gives frames the times of a video by the last number in each name. A name without one has no time.
fn timed_by_names(frames: &mut [RawFrame], fps: f64, path: &Path, findings: &mut Findings) {
    if frames.iter().any(|frame| frame.time.is_some()) {
        findings.warn(format!("{}: its photos have times, so that data.fps is not used", path.display()));
        return;
    }
    let number = |frame: &RawFrame| -> Option<f64> {
        let name = frame.name.rsplit('/').next()?.trim_end_matches(|c: char| !c.is_ascii_digit());
        let digits = name.rsplit(|c: char| !c.is_ascii_digit()).next()?;
        digits.parse().ok()
    };
    let first = frames.iter().filter_map(number).fold(f64::INFINITY, f64::min);
    frames.iter_mut().for_each(|frame| frame.time = number(frame).map(|number| (number - first) / fps));
}

/// Sorts by name as every published split does, drops repeated frames and makes names unique.
fn sort_and_name(mut frames: Vec<RawFrame>, findings: &mut Findings) -> Vec<RawFrame> {
    frames.sort_by(|a, b| a.name.cmp(&b.name).then_with(|| a.image_path.cmp(&b.image_path)));
    let mut repeated = Vec::new();
    frames.dedup_by(|later, first| {
        let same = later.image_path == first.image_path && later.time == first.time;
        if same {
            repeated.push(later.name.clone());
            first.split = std::cmp::min(first.split.take(), later.split.take());
        }
        same
    });
    if !repeated.is_empty() {
        findings.warn(format!(
            "{} listed more than once; the first of each was kept ({})",
            clause(repeated.len(), "frame", "is", "are"),
            some_names(&repeated)
        ));
    }
    names::make_unique(frames.iter_mut().map(|frame| &mut frame.name));
    frames
}

/// A whole number of units near the cameras' middle where that is far from the world's origin, in units and in the
/// cameras' own distances; otherwise the origin.
fn origin(frames: &[RawFrame], options: &LoadOptions) -> DVec3 {
    /// At ten times the cameras' reach an f32 has three bits fewer for them than at the origin.
    const REACHES: f64 = 10.0;
    let centres: Vec<DVec3> = frames.iter().map(|frame| frame.c2w.w_axis.truncate()).collect();
    let centres = without_strays(&centres);
    let Some(mean) = mean(&centres).filter(|_| options.recentre) else { return DVec3::ZERO };
    let reach = centres.iter().map(|centre| centre.distance(mean)).fold(0.0, f64::max);
    if mean.length() > RECENTRE_DISTANCE.max(REACHES * reach) { mean.round() } else { DVec3::ZERO }
}
