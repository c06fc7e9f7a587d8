//! Sweeps and boxes.

use std::path::Path;

use glam::{DMat4, DVec3};
use gs_datasets::DatasetError;

use super::describe::{LIDAR, seconds};
use super::poses::transforms;
use crate::boxes::{self, Boxed};
use crate::description::Frame;
use crate::feather::table::Feather;
use crate::sweep::{Cuboid, RANGE_MAX, Sweep};

/// Lasers from this number on are of the lower LiDAR.
const LOWER: f64 = 32.0;

/// The sweep of a frame. Points are those of the ego vehicle at the time of the frame; its pose brings them to the
/// city.
pub(crate) fn read(log: &Path, frame: &Frame) -> Result<Sweep, DatasetError> {
    let path = log.join(LIDAR).join(format!("{}.feather", frame.name));
    let file = Feather::open(&path)?;
    let [x, y, z] = [file.numbers("x")?, file.numbers("y")?, file.numbers("z")?];
    let (intensity, laser) = (file.numbers("intensity")?, file.numbers("laser_number")?);
    let offset = file.integers("offset_ns")?;
    let stamp = stamp(&path, frame)?;
    let points: Vec<DVec3> = (0..x.len()).map(|i| DVec3::new(x[i], y[i], z[i])).collect();
    let kept: Vec<usize> = (0..points.len()).filter(|i| points[*i].length() <= RANGE_MAX).collect();
    Ok(Sweep {
        points: kept.iter().map(|i| frame.ego.transform_point3(points[*i]).as_vec3().to_array()).collect(),
        times: kept.iter().map(|i| seconds(stamp.saturating_add(offset[*i]))).collect(),
        intensity: kept.iter().map(|i| intensity[*i] as f32).collect(),
        sensor: kept.iter().map(|i| u8::from(laser[*i] >= LOWER)).collect(),
        labels: None,
        left_out: points.len() - kept.len(),
    })
}

/// The sweep of a frame with labels by its boxes; `next` is the frame behind it.
pub(crate) fn labelled(log: &Path, frame: &Frame, next: Option<&Frame>) -> Result<Sweep, DatasetError> {
    let mut sweep = read(log, frame)?;
    let this = cuboids(log, frame)?;
    if !this.is_empty() {
        let later = || next.map(|next| cuboids(log, next).map(Boxed::at_frame_time)).transpose();
        sweep.labels = Some(boxes::labels(&sweep, &this, next.map(|next| next.time - frame.time), later)?);
    }
    Ok(sweep)
}

fn stamp(path: &Path, frame: &Frame) -> Result<i64, DatasetError> {
    frame
        .name
        .parse()
        .map_err(|_| DatasetError::malformed(path, "the name", "a time stamp in nanoseconds", frame.name.clone()))
}

/// The boxes of a frame; none where the log has no annotations, as logs for testing. The heading is taken; the small
/// pitch and roll of the vehicle are not.
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

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::options::LogOptions;

    /// The flow labels of the sample were made by the data set's own program from the same boxes.
    #[test]
    #[ignore = "needs GS_ARGOVERSE"]
    fn flow_agrees_with_the_labels_of_the_sample() {
        let log = PathBuf::from(std::env::var_os("GS_ARGOVERSE").expect("a folder"));
        let described = super::super::describe::describe(&log, &LogOptions::default()).expect("described");
        let (this, next) = (&described.frames[0], &described.frames[1]);
        let sweep = labelled(&log, this, Some(next)).expect("a sweep");
        let file = Feather::open(&log.join("flow_labels.feather")).expect("labels");
        let axis = |name: &str| file.numbers(name).expect("a column");
        let [x, y, z] = [axis("flow_tx_m"), axis("flow_ty_m"), axis("flow_tz_m")];
        let flow = sweep.labels.as_ref().map(|labels| &labels.flow).expect("labels");
        let ground = super::super::ground::MapGround::read(&log, described.origin).expect("a map");
        let is_ground = file.numbers("is_ground_0").expect("a column");
        let differing = (0..sweep.len()).filter(|i| ground.has(sweep.points[*i]) != (is_ground[*i] > 0.5)).count();
        // Positions of the sample's own program are f32 in the city, which is 4 km from its origin.
        assert!(differing * 1000 < sweep.len(), "{differing} of {} points are ground in one alone", sweep.len());
        let (mut moving, mut off) = (0, Vec::new());
        for (i, point) in sweep.points.iter().enumerate() {
            let world = DVec3::from_array(point.map(f64::from));
            let ego = this.ego.inverse().transform_point3(world);
            // The label is from the ego vehicle's axes at the first sweep to those at the second.
            let later = next.ego.transform_point3(ego + DVec3::new(x[i], y[i], z[i]));
            let label = later - world;
            let Some(found) = flow[i] else { continue };
            moving += usize::from(label.length() > 0.05);
            let interval = next.time - this.time;
            let found = DVec3::from_array(found.map(f64::from)) * interval / boxes::FLOW_INTERVAL;
            off.push(found.distance(label));
        }
        off.sort_by(f64::total_cmp);
        let at = |share: f64| off[(share * (off.len() - 1) as f64) as usize];
        println!(
            "{moving} moving; off by {:.4} m at 50 %, {:.4} at 95 %, {:.4} at 99 %, {:.4} at 99.9 %",
            at(0.5),
            at(0.95),
            at(0.99),
            at(0.999)
        );
        // Labels are from f32 and f16 positions; boxes here keep the heading alone, and their margin is applied on all
        // four sides.
        assert!(moving > 1000 && at(0.5) < 0.005 && at(0.99) < 0.05, "{moving} moving, {} and {} m", at(0.5), at(0.99));
    }
}
