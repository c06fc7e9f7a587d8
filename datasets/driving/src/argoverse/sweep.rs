//! Sweeps and boxes.

use std::path::Path;

use glam::{DMat4, DVec3};
use gs_datasets::DatasetError;

use super::describe::{LIDAR, seconds};
use super::poses::transforms;
use crate::boxes;
use crate::description::Frame;
use crate::error::malformed;
use crate::feather::table::Feather;
use crate::sweep::{Cuboid, RANGE_MAX, Sweep};

/// Lasers from this number on are of the lower LiDAR.
const LOWER: f64 = 32.0;

/// Longest time between two sweeps whose boxes are compared for flow, seconds: one may be missing.
const PAIR_MAX: f64 = 0.25;

/// The sweep of a frame with labels by its boxes. Points are those of the ego vehicle at the time of the frame; its pose brings them to the
/// city.
pub(crate) fn read(log: &Path, frame: &Frame, next: Option<&Frame>) -> Result<Sweep, DatasetError> {
    let path = log.join(LIDAR).join(format!("{}.feather", frame.name));
    let file = Feather::open(&path)?;
    let [x, y, z] = [file.numbers("x")?, file.numbers("y")?, file.numbers("z")?];
    let (intensity, laser) = (file.numbers("intensity")?, file.numbers("laser_number")?);
    let offset = file.integers("offset_ns")?;
    let stamp = stamp(&path, frame)?;
    let points: Vec<DVec3> = (0..x.len()).map(|i| DVec3::new(x[i], y[i], z[i])).collect();
    let kept: Vec<usize> = (0..points.len()).filter(|i| points[*i].length() <= RANGE_MAX).collect();
    let mut sweep = Sweep {
        points: kept.iter().map(|i| frame.ego.transform_point3(points[*i]).as_vec3().to_array()).collect(),
        times: kept.iter().map(|i| seconds(stamp.saturating_add(offset[*i]))).collect(),
        intensity: kept.iter().map(|i| intensity[*i] as f32).collect(),
        sensor: kept.iter().map(|i| u8::from(laser[*i] >= LOWER)).collect(),
        labels: None,
        left_out: points.len() - kept.len(),
    };
    let this = cuboids(log, frame)?;
    if !this.is_empty() {
        let next = next.filter(|next| next.time - frame.time <= PAIR_MAX);
        let later = match next {
            Some(next) => Some((cuboids(log, next)?, next.time - frame.time)),
            None => None,
        };
        let later = later.as_ref().map(|(boxes, interval)| (&boxes[..], *interval));
        sweep.labels = Some(boxes::labels(&sweep.points, &sweep.sensor, &this, later));
    }
    Ok(sweep)
}

fn stamp(path: &Path, frame: &Frame) -> Result<i64, DatasetError> {
    frame.name.parse().map_err(|_| malformed(path, "the name", "a time stamp in nanoseconds", frame.name.clone()))
}

/// The boxes of a frame; none where the log has no annotations, as logs for testing. The heading is taken; the small pitch and roll of
/// the vehicle are not.
pub(crate) fn cuboids(log: &Path, frame: &Frame) -> Result<Vec<Cuboid>, DatasetError> {
    let path = log.join("annotations.feather");
    if !path.exists() {
        return Ok(Vec::new());
    }
    let file = Feather::open(&path)?;
    let stamp = stamp(&path, frame)?;
    let times = file.integers("timestamp_ns")?;
    let (tracks, labels) = (file.texts("track_uuid")?, file.texts("category")?);
    let [length, width, height] = [file.numbers("length_m")?, file.numbers("width_m")?, file.numbers("height_m")?];
    let poses = transforms(&file, &path)?;
    let sizes = (0..times.len()).map(|i| DVec3::new(length[i], width[i], height[i]));
    let rows =
        times.iter().zip(sizes).enumerate().filter(|(_, (time, size))| **time == stamp && size.min_element() > 0.0);
    Ok(rows
        .map(|(i, (_, size))| {
            let pose: DMat4 = frame.ego * poses[i];
            let ahead = pose.x_axis;
            Cuboid {
                track: tracks[i].clone(),
                label: labels[i].clone(),
                centre: pose.w_axis.truncate(),
                size,
                yaw: ahead.y.atan2(ahead.x),
                sensor: None,
                id: tracks[i].clone(),
            }
        })
        .collect())
}
