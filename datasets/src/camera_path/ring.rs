//! Round the subject, and a spiral before it.

use std::f64::consts::TAU;

use glam::{DMat4, DVec3};
use gs_base::median;

use super::{looking, up};
use crate::frame::CameraPose;
use crate::subject::nearest_to_axes;

/// Turns of a spiral.
const TURNS: f64 = 2.0;

/// Radius of a spiral in mean distances of the cameras from their middle: well inside what was photographed.
const SPIRAL_SHARE: f64 = 0.7;

/// `count` cameras on a circle round the point that all of `cameras` look at, at their median distance and height,
/// upright. The first is on the side of the first camera and has its lens. `None` where the cameras look at no common
/// point.
pub fn orbit(cameras: &[CameraPose], count: usize) -> Option<Vec<CameraPose>> {
    let (up, subject, first) = (up(cameras)?, subject(cameras)?, cameras.first()?);
    let offsets: Vec<DVec3> = cameras.iter().map(|camera| camera.c2w.w_axis.truncate() - subject).collect();
    let height = median(offsets.iter().map(|offset| offset.dot(up)).collect())?;
    let radius = median(offsets.iter().map(|offset| offset.reject_from(up).length()).collect())?;
    let ahead = offsets[0].reject_from(up).try_normalize()?;
    let aside = up.cross(ahead);
    let camera = |index: usize| {
        let angle = TAU * index as f64 / count as f64;
        let centre = subject + up * height + (ahead * angle.cos() + aside * angle.sin()) * radius;
        named(first, "orbit", index, looking(centre, subject, up)?)
    };
    (0..count).map(camera).collect()
}

/// `count` cameras on a flat spiral about the middle of `cameras`, looking at what they look at, with the lens of the
/// first. `None` where they look at no common point.
pub fn spiral(cameras: &[CameraPose], count: usize) -> Option<Vec<CameraPose>> {
    let (up, subject, first) = (up(cameras)?, subject(cameras)?, cameras.first()?);
    let centres: Vec<DVec3> = cameras.iter().map(|camera| camera.c2w.w_axis.truncate()).collect();
    let middle = centres.iter().sum::<DVec3>() / centres.len() as f64;
    let view = looking(middle, subject, up)?;
    let (right, over) = (view.x_axis.truncate(), -view.y_axis.truncate());
    let spread = |axis: DVec3| {
        SPIRAL_SHARE * centres.iter().map(|centre| (*centre - middle).dot(axis).abs()).sum::<f64>()
            / centres.len() as f64
    };
    let (wide, high) = (spread(right), spread(over));
    let camera = |index: usize| {
        let share = index as f64 / count as f64;
        let (sin, cos) = (TAU * TURNS * share).sin_cos();
        // Out and in again, so that the end meets the begin.
        let reach = 0.5 - 0.5 * (TAU * share).cos();
        let centre = middle + reach * (right * wide * cos + over * high * sin);
        named(first, "spiral", index, looking(centre, subject, up)?)
    };
    (0..count).map(camera).collect()
}

fn named(lens: &CameraPose, path: &str, index: usize, c2w: DMat4) -> Option<CameraPose> {
    Some(CameraPose { name: format!("{path}_{index:04}"), c2w, time: None, ..lens.clone() })
}

/// The point nearest to all axes, if it is before the cameras on the whole.
fn subject(cameras: &[CameraPose]) -> Option<DVec3> {
    let poses: Vec<DMat4> = cameras.iter().map(|camera| camera.c2w).collect();
    // Parallel axes have a determinant of 0; a handheld rig before one object has 0.005 and more.
    let subject = nearest_to_axes(&poses, 1e-4)?;
    let depth = median(poses.iter().map(|c2w| (subject - c2w.w_axis.truncate()).dot(c2w.z_axis.truncate())).collect())?;
    (depth > 0.0).then_some(subject)
}
