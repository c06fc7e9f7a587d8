//! Poses, calibrations and frames.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use glam::DMat4;
use gs_base::{agree, counted};
use gs_datasets::DatasetError;

use super::keys::{CAMERA, Key, Keys, LASER};
use super::{Component, Modular, file};
use crate::waymo::calibration::{CameraCalibration, LaserCalibration};
use crate::waymo::names::VEHICLE_POSE;
use crate::waymo::parquet::table::{Cells, Table};
use crate::waymo::parts::{CAMERAS, FramePart, ImagePart, LASERS, Parts, rigid};

/// Names of sensors in a key.
const OF_CAMERA: (&str, &[&str]) = (CAMERA, &CAMERAS);
const OF_LASER: (&str, &[&str]) = (LASER, &LASERS);

impl Modular {
    /// Describes the segment of a name.
    pub fn open(root: &Path, name: &str) -> Result<(Parts, Self), DatasetError> {
        let poses = Component::open(root, VEHICLE_POSE, name, None)?;
        poses.keys.are_single(poses.table.path())?;
        let source = Self {
            root: root.to_path_buf(),
            name: name.to_string(),
            lidar: Component::open(root, "lidar", name, Some(OF_LASER))?,
            lidar_pose: Component::open(root, "lidar_pose", name, Some(OF_LASER))?,
            images: optional(root, "camera_image", name, Some(OF_CAMERA))?,
            boxes: optional(root, "lidar_box", name, None)?,
        };
        for component in [Some(&source.lidar), Some(&source.lidar_pose), source.images.as_ref()].into_iter().flatten() {
            component.keys.are_single(component.table.path())?;
        }
        let mut warnings = Vec::new();
        let cameras = match &source.images {
            Some(_) => cameras(&Table::open(&file(root, "camera_calibration", name))?)?,
            None => {
                warnings.push("there is no component camera_image, and no camera".to_string());
                BTreeMap::new()
            }
        };
        let lasers = lasers(&Table::open(&file(root, "lidar_calibration", name))?)?;
        let mut images = match &source.images {
            Some(component) => images(component)?,
            None => BTreeMap::new(),
        };
        let swept: BTreeSet<i64> = source.lidar.keys.all().iter().map(|key| key.stamp).collect();
        let transforms = transforms(&poses.table, "[VehiclePoseComponent].world_from_vehicle.transform", &poses.keys)?;
        let frames: Vec<FramePart> = transforms
            .into_iter()
            .map(|(key, pose)| FramePart {
                stamp: key.stamp,
                pose,
                images: images.remove(&key.stamp).unwrap_or_default(),
                has_sweep: swept.contains(&key.stamp),
            })
            .collect();
        if !images.is_empty() {
            let verb = agree(images.len(), "has", "have");
            warnings.push(format!("{} of images {verb} no pose of the vehicle", counted(images.len(), "time stamp")));
        }
        Ok((Parts { name: name.to_string(), cameras, lasers, frames, warnings }, source))
    }
}

fn optional(
    root: &Path,
    component: &str,
    name: &str,
    sensor: Option<(&str, &[&str])>,
) -> Result<Option<Component>, DatasetError> {
    match file(root, component, name).exists() {
        true => Component::open(root, component, name, sensor).map(Some),
        false => Ok(None),
    }
}

/// The values that a function reads of all rows of a table, with their keys.
fn rows<T>(
    table: &Table,
    keys: &Keys,
    columns: &[&str],
    mut row: impl FnMut(&[Cells], usize) -> Option<T>,
) -> Result<Vec<(Key, T)>, DatasetError> {
    let groups = table.groups().into_iter().enumerate();
    let cells: Vec<Vec<Cells>> = groups
        .map(|(group, count)| columns.iter().map(|column| table.cells(group, column, 0..count)).collect())
        .collect::<Result<_, _>>()?;
    let read = |key: &Key| match row(&cells[key.group], key.row) {
        Some(found) => Ok((*key, found)),
        None => {
            let expected = format!("sound values of {}", columns.join(", "));
            Err(DatasetError::malformed(table.path(), key.to_string(), expected, "others"))
        }
    };
    keys.all().iter().map(read).collect()
}

fn transforms(table: &Table, column: &str, keys: &Keys) -> Result<Vec<(Key, DMat4)>, DatasetError> {
    rows(table, keys, &[column], |cells, row| rigid(&cells[0].numbers(row)?))
}

/// The only number of a cell.
pub(super) fn number(cells: &Cells, row: usize) -> Option<f64> {
    match cells.numbers(row)?[..] {
        [number] => Some(number),
        _ => None,
    }
}

fn images(component: &Component) -> Result<BTreeMap<i64, BTreeMap<i64, ImagePart>>, DatasetError> {
    let columns = ["[CameraImageComponent].pose.transform", "[CameraImageComponent].pose_timestamp"];
    let found = rows(&component.table, &component.keys, &columns, |cells, row| {
        let time = number(&cells[1], row).filter(|time| time.is_finite())?;
        Some(ImagePart { pose: rigid(&cells[0].numbers(row)?)?, time })
    })?;
    let mut images: BTreeMap<i64, BTreeMap<i64, ImagePart>> = BTreeMap::new();
    for (key, image) in found {
        images.entry(key.stamp).or_default().insert(key.sensor, image);
    }
    Ok(images)
}

fn cameras(table: &Table) -> Result<BTreeMap<i64, CameraCalibration>, DatasetError> {
    let keys = Keys::read(table, false, Some(OF_CAMERA))?;
    keys.are_single(table.path())?;
    let names = ["f_u", "f_v", "c_u", "c_v", "k1", "k2", "p1", "p2", "k3"];
    let mut columns: Vec<String> =
        names.iter().map(|name| format!("[CameraCalibrationComponent].intrinsic.{name}")).collect();
    let others = ["extrinsic.transform", "width", "height"];
    columns.extend(others.iter().map(|name| format!("[CameraCalibrationComponent].{name}")));
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let found = rows(table, &keys, &columns, |cells, row| {
        let mut intrinsic = [0.0; 9];
        for (value, cells) in intrinsic.iter_mut().zip(cells) {
            *value = number(cells, row)?;
        }
        let extrinsic = rigid(&cells[9].numbers(row)?)?;
        let side = |column: usize| Some(number(&cells[column], row)? as i64);
        Some(CameraCalibration { intrinsic, extrinsic, size: (side(10)?, side(11)?) })
    })?;
    Ok(found.into_iter().map(|(key, camera)| (key.sensor, camera)).collect())
}

fn lasers(table: &Table) -> Result<BTreeMap<i64, LaserCalibration>, DatasetError> {
    let keys = Keys::read(table, false, Some(OF_LASER))?;
    keys.are_single(table.path())?;
    let columns = ["extrinsic.transform", "beam_inclination.values", "beam_inclination.min", "beam_inclination.max"]
        .map(|name| format!("[LiDARCalibrationComponent].{name}"));
    let columns = columns.each_ref().map(String::as_str);
    let found = rows(table, &keys, &columns, |cells, row| {
        let bounds = number(&cells[2], row).zip(number(&cells[3], row));
        let inclinations = cells[1].numbers(row)?;
        Some(LaserCalibration { extrinsic: rigid(&cells[0].numbers(row)?)?, inclinations, bounds })
    })?;
    Ok(found.into_iter().map(|(key, laser)| (key.sensor, laser)).collect())
}
