//! Measurements on poses and points that show a wrong convention or a bad reconstruction at a glance.

use std::collections::HashMap;
use std::fmt;
use std::path::Path;

use glam::DVec3;
use gs_base::{agree, counted, mean, median, sentence};

use crate::formats::colmap::model::Model;
use crate::lens::Lens;
use crate::pose;
use crate::raw::{RawFrame, RawPoints};
use crate::subject::{STRAY, strays};

/// Distances between where points are seen and where they project, pixels of the distorted image.
pub(super) struct Reprojection {
    pub median: f64,
    mean: f64,
    /// The mean of the errors the model stores, each weighted by the number of its point's observations.
    stored_mean: f64,
    observations: usize,
}

impl fmt::Display for Reprojection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "Points reproject with an error of {:.3} pixels (median; mean {:.3}, the model says {:.3}) over {}.",
            self.median,
            self.mean,
            self.stored_mean,
            counted(self.observations, "observation")
        )
    }
}

/// Recomputes the reprojection error through pose, distortion and intrinsics; `None` without usable observations.
pub(super) fn reprojection(model: &Model, cameras_file: &Path) -> Option<Reprojection> {
    let points: HashMap<u64, usize> = model.points.iter().enumerate().map(|(i, (id, _))| (*id, i)).collect();
    let (mut errors, mut stored) = (Vec::new(), 0.0);
    for image in &model.images {
        let lens =
            model.cameras.get(&image.camera_id).and_then(|camera| camera.lens(image.camera_id, cameras_file).ok());
        let c2w = pose::from_world_to_camera(image.q, image.t, cameras_file, &image.name).ok();
        let (Some(lens), Some(c2w)) = (lens, c2w) else { continue };
        let w2c = c2w.inverse();
        for (x, y, id) in &image.observations {
            let Some((_, point)) = points.get(id).and_then(|i| model.points.get(*i)) else { continue };
            let seen = project(&lens, w2c.transform_point3(point.position));
            let distance = seen.map(|(u, v)| (u - x).hypot(v - y)).filter(|distance| distance.is_finite());
            if let Some(distance) = distance {
                errors.push(distance);
                stored += point.error;
            }
        }
    }
    errors.sort_by(f64::total_cmp);
    let count = errors.len() as f64;
    Some(Reprojection {
        median: *errors.get(errors.len() / 2)?,
        mean: errors.iter().sum::<f64>() / count,
        stored_mean: stored / count,
        observations: errors.len(),
    })
}

/// Where the photo (with its distortion) shows a point in camera coordinates, pixels; `None` behind a pinhole.
fn project(lens: &Lens, point: DVec3) -> Option<(f64, f64)> {
    let intrinsics = lens.intrinsics(lens.width?, lens.height?)?;
    let (x, y) = lens.projection.of_ray(point)?;
    let (x, y) = lens.distortion.apply(x, y);
    Some((x * intrinsics.fx + intrinsics.cx, y * intrinsics.fy + intrinsics.cy))
}

pub(super) fn describe_model(model: &Model) -> String {
    let mut names: Vec<&str> = model.cameras.values().map(|camera| camera.model).collect();
    names.sort_unstable();
    names.dedup();
    format!(
        "It lists cameras: {} ({}); images: {}; points: {}.",
        model.cameras.len(),
        names.join(", "),
        model.images.len(),
        model.points.len()
    )
}

pub(super) fn describe_points(points: Option<&RawPoints>) -> String {
    let Some(points) = points.filter(|points| !points.positions.is_empty()) else {
        return "There are no points to start from.".to_string();
    };
    let low = points.positions.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = points.positions.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let places = decimals((high - low).max_element());
    let position = |value| sentence::position(value, places);
    let count = points.positions.len();
    let lie = agree(count, "lies", "lie");
    let far = strays(&points.positions).into_iter().filter(|stray| *stray).count();
    let outliers = match far {
        0 => String::new(),
        _ => format!("; {far} of them more than {STRAY} times as far out as three quarters"),
    };
    let (low, high) = (position(low), position(high));
    format!("{} to start from {lie} between {low} and {high}{outliers}.", counted(count, "point"))
}

/// How far cameras stand apart and whether they look at something together.
pub(super) fn describe_cameras(frames: &[RawFrame]) -> String {
    let centres: Vec<DVec3> = frames.iter().map(|frame| frame.c2w.w_axis.truncate()).collect();
    let Some(middle) = mean(&centres) else { return "There are no cameras.".to_string() };
    let distances: Vec<f64> = centres.iter().map(|centre| centre.distance(middle)).collect();
    let farthest = distances.iter().copied().fold(0.0, f64::max);
    let median = median(distances).unwrap_or(0.0);
    let gaze = frames.iter().map(|frame| frame.c2w.z_axis.truncate()).sum::<DVec3>().length() / frames.len() as f64;
    let look = if gaze > 0.9 {
        "they face one way"
    } else if gaze < 0.4 {
        "they look from all around"
    } else {
        "they look from several sides"
    };
    let places = decimals(farthest);
    format!(
        "Cameras stand around {}, at distances of {} (median) to {}; {look}.",
        sentence::position(middle, places),
        three_digits(median),
        sentence::decimals(farthest, places)
    )
}

/// The number with three significant digits: a world may be of any size.
fn three_digits(value: f64) -> String {
    sentence::decimals(value, decimals(value))
}

/// Decimals that show three digits of `size`; 2 where it has none to show.
fn decimals(size: f64) -> usize {
    // Below this even f64 coordinates are rounding, and a line has an end.
    const SMALLEST: f64 = 1e-9;
    if !size.is_finite() || size < SMALLEST {
        return 2;
    }
    (2 - size.log10().floor() as i32).max(0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_whatever_the_size() {
        for (value, text) in [
            (4.1231, "4.12"),
            (0.0041231, "0.00412"),
            (41.231, "41.2"),
            (41231.0, "41231"),
            (0.0, "0.00"),
            (1e300, "1.00e300"),
        ] {
            assert_eq!(three_digits(value), text);
        }
    }
}
