//! The true motion of the bodies of a synthetic world, read from its data set.

use std::path::Path;

use glam::{DQuat, DVec3};
use gs_base::guarded::{DESCRIPTION_MAX, read_to_string};
use serde::Deserialize;

use crate::error::DatasetError;

/// Files of a data set that name its bodies.
const DESCRIPTIONS: [&str; 2] = ["transforms_train.json", "transforms.json"];

/// A body of a synthetic world with its true motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Mover {
    /// Its name.
    pub name: String,
    /// The radius of a ball around its position that holds it, scene units.
    pub radius: f64,
    /// Time, position and orientation, times ascending.
    poses: Vec<(f64, DVec3, DQuat)>,
}

#[derive(Deserialize)]
struct Description {
    #[serde(default)]
    movers: Vec<Described>,
}

#[derive(Deserialize)]
struct Described {
    name: String,
    radius: f64,
    poses: Vec<DescribedPose>,
}

#[derive(Deserialize)]
struct DescribedPose {
    time: f64,
    position: [f64; 3],
    quaternion_wxyz: [f64; 4],
}

/// The bodies of the world at `dataset`, a folder or its description, with `origin` subtracted; none where it does not
/// name any.
///
/// # Errors
/// When its description names bodies in a form that cannot be read.
pub fn movers(dataset: &Path, origin: DVec3) -> Result<Vec<Mover>, DatasetError> {
    let path = match dataset.is_dir() {
        true => DESCRIPTIONS.iter().map(|name| dataset.join(name)).find(|path| path.is_file()),
        false => dataset.extension().is_some_and(|end| end == "json").then(|| dataset.to_path_buf()),
    };
    let Some(path) = path else { return Ok(Vec::new()) };
    let text = read_to_string(&path, DESCRIPTION_MAX)?;
    if !text.contains("\"movers\"") {
        return Ok(Vec::new());
    }
    let description: Description = serde_json::from_str(&text).map_err(|error| {
        DatasetError::malformed(&path, "movers", "bodies with name, radius and poses", error.to_string())
    })?;
    Ok(description.movers.into_iter().map(|described| described.read(origin)).collect())
}

impl Described {
    fn read(self, origin: DVec3) -> Mover {
        let pose = |pose: DescribedPose| {
            let [w, x, y, z] = pose.quaternion_wxyz;
            (pose.time, DVec3::from_array(pose.position) - origin, DQuat::from_xyzw(x, y, z, w).normalize())
        };
        let mut poses: Vec<_> = self.poses.into_iter().map(pose).collect();
        poses.sort_by(|a, b| a.0.total_cmp(&b.0));
        Mover { name: self.name, radius: self.radius, poses }
    }
}

impl Mover {
    /// First and last time that is known; `None` without any.
    pub fn span(&self) -> Option<[f64; 2]> {
        Some([self.poses.first()?.0, self.poses.last()?.0])
    }

    /// The body's position at a time; `None` outside the times that are known.
    pub fn position(&self, time: f64) -> Option<DVec3> {
        Some(self.pose(time)?.0)
    }

    /// Where the body carries a point that it held at `from`, at `to`; `None` outside the times that are known.
    pub fn carried(&self, point: DVec3, from: f64, to: f64) -> Option<DVec3> {
        let ((before, turned), (after, turn)) = (self.pose(from)?, self.pose(to)?);
        Some(after + turn * (turned.inverse() * (point - before)))
    }

    /// The pose at a time, between the two nearest known ones.
    fn pose(&self, time: f64) -> Option<(DVec3, DQuat)> {
        let next = self.poses.iter().position(|pose| pose.0 >= time)?;
        let (t1, x1, q1) = self.poses[next];
        if t1 == time {
            return Some((x1, q1));
        }
        let (t0, x0, q0) = *self.poses.get(next.checked_sub(1)?)?;
        let share = (time - t0) / (t1 - t0);
        Some((x0.lerp(x1, share), q0.slerp(q1, share)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_body_carries_its_points() {
        let turned = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let mover = Mover {
            name: "rotor".into(),
            radius: 1.0,
            poses: vec![(0.0, DVec3::X, DQuat::IDENTITY), (1.0, DVec3::Y, turned)],
        };
        let carried = mover.carried(DVec3::new(2.0, 0.0, 0.0), 0.0, 1.0).expect("known");
        assert!(carried.distance(DVec3::new(0.0, 2.0, 0.0)) < 1e-12, "{carried}");
        assert_eq!(mover.position(0.5), Some(DVec3::new(0.5, 0.5, 0.0)));
        assert_eq!((mover.position(1.5), mover.position(-0.5), mover.span()), (None, None, Some([0.0, 1.0])));
    }

    #[test]
    fn a_folder_without_a_description_has_no_bodies() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(movers(folder.path(), DVec3::ZERO).expect("read").is_empty());
        let path = folder.path().join("transforms_train.json");
        std::fs::write(&path, "{\"movers\": 3}").expect("written");
        assert!(movers(folder.path(), DVec3::ZERO).is_err());
    }
}
