//! Poses of the ego vehicle over time, and poses and intrinsics of sensors.

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DMat4, DQuat, DVec3};
use gs_base::Intrinsics;
use gs_datasets::DatasetError;

use crate::feather::table::Feather;

/// The file with the ego vehicle's poses.
pub(crate) const EGO: &str = "city_SE3_egovehicle.feather";
/// The folder of the images.
pub(super) const CAMERAS: &str = "sensors/cameras";

/// Farthest in time that a pose may be from what it is used for, nanoseconds. A row exists for every time stamp of a
/// sensor; a metre a hundredth of a second is the speed of the fastest vehicle.
const POSE_MAX: i64 = 10_000_000;

/// Rigid transforms of a table, row by row.
pub(crate) fn transforms(file: &Feather, path: &Path) -> Result<Vec<DMat4>, DatasetError> {
    let column = |name: &str| file.numbers(name);
    let [w, x, y, z] = [column("qw")?, column("qx")?, column("qy")?, column("qz")?];
    let [tx, ty, tz] = [column("tx_m")?, column("ty_m")?, column("tz_m")?];
    (0..w.len())
        .map(|i| {
            let (turn, shift) = (DQuat::from_xyzw(x[i], y[i], z[i], w[i]), DVec3::new(tx[i], ty[i], tz[i]));
            if !((turn.length() - 1.0).abs() < 1e-2 && shift.is_finite()) {
                let found = format!("length {} and position {shift}", turn.length());
                return Err(DatasetError::malformed(
                    path,
                    format!("row {i}"),
                    "a rotation of length 1 and a position",
                    found,
                ));
            }
            Ok(DMat4::from_rotation_translation(turn.normalize(), shift))
        })
        .collect()
}

/// Ego vehicle to city over time.
pub(crate) struct Track {
    poses: BTreeMap<i64, DMat4>,
}

impl Track {
    /// Reads the poses of a log.
    pub fn read(log: &Path) -> Result<Self, DatasetError> {
        let path = log.join(EGO);
        let file = Feather::open(&path)?;
        let times = file.integers("timestamp_ns")?;
        Ok(Self { poses: times.into_iter().zip(transforms(&file, &path)?).collect() })
    }

    /// The pose at a time, nanoseconds.
    pub fn at(&self, log: &Path, time: i64) -> Result<DMat4, DatasetError> {
        let before = self.poses.range(..=time).next_back();
        let after = self.poses.range(time..).next();
        let off = |entry: &(&i64, &DMat4)| entry.0.abs_diff(time);
        let nearest = before.into_iter().chain(after).min_by_key(off);
        let close = nearest.filter(|entry| off(entry) <= POSE_MAX as u64).map(|entry| *entry.1);
        close.ok_or_else(|| {
            DatasetError::malformed(
                &log.join(EGO),
                "the poses",
                format!("a pose within 10 ms of the time {time} ns"),
                "none",
            )
        })
    }
}

/// A camera as the calibration describes it.
pub(crate) struct Calibrated {
    pub name: String,
    /// Camera to ego vehicle.
    pub pose: DMat4,
    /// At `size`.
    pub intrinsics: Intrinsics,
    pub size: (f64, f64),
}

/// The cameras of a log. Images are undistorted already, so the coefficients of the lens are not read. A log of the
/// LiDAR data set has neither images nor intrinsics, and no camera.
pub(crate) fn cameras(log: &Path) -> Result<Vec<Calibrated>, DatasetError> {
    let (inner, outer) =
        (log.join("calibration/intrinsics.feather"), log.join("calibration/egovehicle_SE3_sensor.feather"));
    if !inner.exists() && !log.join(CAMERAS).exists() {
        return Ok(Vec::new());
    }
    let file = Feather::open(&outer)?;
    let poses: BTreeMap<String, DMat4> =
        file.texts("sensor_name")?.into_iter().zip(transforms(&file, &outer)?).collect();
    let file = Feather::open(&inner)?;
    let names = file.texts("sensor_name")?;
    let column = |name: &str| file.numbers(name);
    let [fx, fy, cx, cy] = [column("fx_px")?, column("fy_px")?, column("cx_px")?, column("cy_px")?];
    let (height, width) = (column("height_px")?, column("width_px")?);
    names
        .into_iter()
        .enumerate()
        .map(|(i, name)| {
            let pose = *poses
                .get(&name)
                .ok_or_else(|| DatasetError::malformed(&outer, "the sensors", format!("a pose of {name}"), "none"))?;
            let intrinsics = Intrinsics { fx: fx[i], fy: fy[i], cx: cx[i], cy: cy[i] };
            let is_sound = fx[i] > 0.0
                && fy[i] > 0.0
                && cx[i].is_finite()
                && cy[i].is_finite()
                && width[i] > 0.0
                && height[i] > 0.0;
            if !is_sound {
                return Err(DatasetError::malformed(
                    &inner,
                    name,
                    "focal lengths and sizes above 0",
                    format!("{intrinsics:?}"),
                ));
            }
            Ok(Calibrated { name, pose, intrinsics, size: (width[i], height[i]) })
        })
        .collect()
}
