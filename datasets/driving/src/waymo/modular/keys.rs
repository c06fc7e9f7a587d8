//! [`Keys`]: the rows of a component by time and sensor. Rows are in any order, and columns too.

use std::fmt;
use std::path::Path;

use gs_datasets::DatasetError;

use crate::waymo::parquet::table::{Cells, Table};
use crate::waymo::parts::number;

/// The column of times.
const STAMP: &str = "key.frame_timestamp_micros";

/// Columns of sensors.
pub(crate) const CAMERA: &str = "key.camera_name";
pub(crate) const LASER: &str = "key.laser_name";

/// A row.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Key {
    /// Microseconds; 0 where the component has no times.
    pub stamp: i64,
    /// Number of the sensor; 0 where the component has none.
    pub sensor: i64,
    /// Group and row in the file.
    pub group: usize,
    pub row: usize,
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "row {} of group {}", self.row, self.group)
    }
}

/// Rows, ascending.
#[derive(Debug, Default)]
pub(crate) struct Keys(Vec<Key>);

impl Keys {
    /// Reads the keys of a table; `sensor` is the column of sensors, which may hold numbers or these names.
    pub fn read(table: &Table, has_times: bool, sensor: Option<(&str, &[&str])>) -> Result<Self, DatasetError> {
        let mut keys = Vec::new();
        for (group, rows) in table.groups().into_iter().enumerate() {
            let stamps = if has_times { Some(table.cells(group, STAMP, 0..rows)?) } else { None };
            let sensors = match sensor {
                Some((column, names)) => Some((table.cells(group, column, 0..rows)?, column, names)),
                None => None,
            };
            for row in 0..rows {
                let missing = |column: &str, expected: &str| {
                    DatasetError::malformed(
                        table.path(),
                        format!("{column} of row {row} of group {group}"),
                        expected,
                        "none",
                    )
                };
                let stamp = match &stamps {
                    Some(cells) => cells.integer(row).ok_or_else(|| missing(STAMP, "microseconds"))?,
                    None => 0,
                };
                let sensor = match &sensors {
                    Some((cells, column, names)) => {
                        sensor_of(cells, row, names).ok_or_else(|| missing(column, "the number or name of a sensor"))?
                    }
                    None => 0,
                };
                keys.push(Key { stamp, sensor, group, row });
            }
        }
        keys.sort_unstable();
        Ok(Self(keys))
    }

    /// All rows.
    pub fn all(&self) -> &[Key] {
        &self.0
    }

    /// The rows of a time.
    pub fn at(&self, stamp: i64) -> &[Key] {
        let start = self.0.partition_point(|key| key.stamp < stamp);
        let count = self.0[start..].partition_point(|key| key.stamp == stamp);
        &self.0[start..start + count]
    }

    /// Fails where a sensor has two rows of a time.
    pub fn are_single(&self, path: &Path) -> Result<(), DatasetError> {
        match self.0.windows(2).find(|pair| (pair[0].stamp, pair[0].sensor) == (pair[1].stamp, pair[1].sensor)) {
            Some(pair) => {
                let place = format!("the rows of the sensor {} at {}", pair[0].sensor, pair[0].stamp);
                Err(DatasetError::malformed(path, place, "one row", "two"))
            }
            None => Ok(()),
        }
    }
}

fn sensor_of(cells: &Cells, row: usize, names: &[&str]) -> Option<i64> {
    let found = cells.integer(row).or_else(|| number(names, cells.bytes(row)?))?;
    (1..=names.len() as i64).contains(&found).then_some(found)
}
