//! Range images, images and boxes of a frame.

use gs_datasets::DatasetError;

use super::keys::Key;
use super::{Component, Modular};
use crate::waymo::parquet::table::Cells;
use crate::waymo::parts::{BoxPart, RangeImage, Scan, TOP};

impl Modular {
    /// The range images of a frame, with the poses of those of the TOP laser.
    pub fn scans(&self, stamp: i64, with_second: bool) -> Result<Vec<Scan>, DatasetError> {
        let keys = self.lidar.keys.at(stamp);
        let mut poses: Vec<Key> = self.lidar_pose.keys.at(stamp).to_vec();
        poses.retain(|key| key.sensor == TOP);
        let pose =
            self.lidar_pose.images(&poses, "[LiDARPoseComponent].range_image_return1")?.pop().map(|(_, pose)| pose);
        let mut scans = Vec::new();
        for column in ["[LiDARComponent].range_image_return1", "[LiDARComponent].range_image_return2"] {
            if column.ends_with('2') && !with_second {
                continue;
            }
            for (laser, image) in self.lidar.images(keys, column)? {
                let pose = if laser == TOP { pose.clone() } else { None };
                scans.push(Scan { laser, image, pose });
            }
        }
        Ok(scans)
    }

    /// The JPEG of a camera in a frame.
    pub fn jpeg(&self, stamp: i64, camera: i64) -> Result<Vec<u8>, DatasetError> {
        const COLUMN: &str = "[CameraImageComponent].image";
        let missing = || {
            DatasetError::malformed(&self.images(), COLUMN, format!("an image of camera {camera} at {stamp}"), "none")
        };
        let component = self.images.as_ref().ok_or_else(missing)?;
        let key = component.keys.at(stamp).iter().find(|key| key.sensor == camera).ok_or_else(missing)?;
        let cells = component.table.cells(key.group, COLUMN, key.row..key.row + 1)?;
        cells.bytes(0).map(<[u8]>::to_vec).ok_or_else(missing)
    }

    /// The boxes of a frame, in the vehicle's axes; none where the component is missing.
    pub fn boxes(&self, stamp: i64) -> Result<Vec<BoxPart>, DatasetError> {
        let Some(component) = &self.boxes else { return Ok(Vec::new()) };
        const NUMBERS: [&str; 7] = ["center.x", "center.y", "center.z", "size.x", "size.y", "size.z", "heading"];
        let names = NUMBERS.map(|name| format!("[LiDARBoxComponent].box.{name}"));
        let mut boxes = Vec::new();
        for keys in by_group(component.keys.at(stamp)) {
            let numbers: Vec<Cells> = names.iter().map(|name| component.cells(keys, name)).collect::<Result<_, _>>()?;
            let kinds = component.cells(keys, "[LiDARBoxComponent].type")?;
            let ids = component.cells(keys, "key.laser_object_id")?;
            for row in 0..keys.len() {
                let mut values = [0.0; 7];
                let read = values.iter_mut().zip(&numbers).try_for_each(|(value, cells)| {
                    *value = super::describe::number(cells, row)?;
                    Some(())
                });
                let [x, y, z, length, width, height, heading] = values;
                let part = || {
                    let id = String::from_utf8_lossy(ids.bytes(row)?).into_owned();
                    let (centre, size) = ([x, y, z], [length, width, height]);
                    Some(BoxPart { id, kind: kinds.integer(row)?, centre, size, heading })
                };
                boxes.push(read.and_then(|()| part()).ok_or_else(|| {
                    let (path, place) = (component.table.path(), keys[row].to_string());
                    DatasetError::malformed(path, place, "a box with a name and a type", "another row")
                })?);
            }
        }
        Ok(boxes)
    }
}

/// Runs of rows of one group; keys of a time are in the order of sensors, and rows of a run ascend.
fn by_group(keys: &[Key]) -> impl Iterator<Item = &[Key]> {
    keys.chunk_by(|a, b| a.group == b.group && a.row < b.row)
}

impl Component {
    fn cells(&self, keys: &[Key], column: &str) -> Result<Cells, DatasetError> {
        let group = keys.first().map_or(0, |key| key.group);
        self.table.cells(group, column, keys.iter().map(|key| key.row))
    }

    /// The images of rows, with the numbers of their sensors; a row without an image is left out.
    fn images(&self, keys: &[Key], column: &str) -> Result<Vec<(i64, RangeImage)>, DatasetError> {
        let (shape, values) = (format!("{column}.shape"), format!("{column}.values"));
        let mut images = Vec::new();
        for keys in by_group(keys) {
            let (shapes, values) = (self.cells(keys, &shape)?, self.cells(keys, &values)?);
            for (row, key) in keys.iter().enumerate() {
                let wrong = |found: String| {
                    let expected = "rows, columns and channels of an image";
                    DatasetError::malformed(self.table.path(), format!("{column} of {key}"), expected, found)
                };
                let sides = shapes.numbers(row).zip(values.floats(row));
                let (sides, values) = sides.ok_or_else(|| wrong("text".to_string()))?;
                if sides.is_empty() && values.is_empty() {
                    continue;
                }
                let sides: Vec<i64> = sides.into_iter().map(|side| side as i64).collect();
                images.push((key.sensor, RangeImage::new(&sides, values).map_err(wrong)?));
            }
        }
        Ok(images)
    }
}
