//! Pickled boxes of a frame.

use std::collections::HashMap;
use std::f64::consts::FRAC_PI_2;
use std::path::Path;

use glam::DVec3;
use gs_datasets::DatasetError;

use super::names;
use crate::pickle::table::{self, Table};
use crate::pickle::value::PickleError;
use crate::sweep::Cuboid;

/// Largest box, metres: three times a train's carriage.
const SIZE_MAX: f64 = 100.0;

/// The LiDAR that looks ahead, whose box of an object is the second one.
const SECOND: f64 = 1.0;

/// The boxes of a frame, `origin` subtracted; none where there is no file. An object that both LiDARs see has one box a
/// LiDAR, because it moved between the two.
pub(crate) fn read(sequence: &Path, stem: &str, origin: DVec3) -> Result<Option<Vec<Cuboid>>, DatasetError> {
    let Some(path) = names::pickle(&sequence.join(names::CUBOIDS), stem) else { return Ok(None) };
    Ok(Some(cuboids(&table::read(&path, rows)?, origin)))
}

/// A row of the table.
struct Row {
    uuid: String,
    label: String,
    sibling: Option<String>,
    sensor: f64,
    yaw: f64,
    centre: DVec3,
    /// Width, length, height.
    size: DVec3,
}

fn rows(table: &Table<'_, '_>) -> Result<Vec<Row>, PickleError> {
    let (uuids, labels, yaws) = (table.texts("uuid")?, table.texts("label")?, table.numbers("yaw")?);
    let centres = table.vectors(["position.x", "position.y", "position.z"])?;
    let sizes = table.vectors(["dimensions.x", "dimensions.y", "dimensions.z"])?;
    // Both are left out of some re-packed files; without them each box is its object's only one.
    let siblings = table.texts("cuboids.sibling_id").unwrap_or_else(|_| vec![None; table.rows]);
    let sensors = table.numbers("cuboids.sensor_id").unwrap_or_else(|_| vec![-1.0; table.rows]);
    Ok((0..table.rows)
        .map(|i| Row {
            uuid: uuids[i].unwrap_or_default().to_string(),
            label: labels[i].unwrap_or_default().to_string(),
            sibling: siblings[i].filter(|id| *id != "-").map(str::to_string),
            sensor: sensors[i],
            yaw: yaws[i],
            centre: centres[i],
            size: sizes[i],
        })
        .collect())
}

fn cuboids(rows: &[Row], origin: DVec3) -> Vec<Cuboid> {
    let by_uuid: HashMap<&str, &Row> = rows.iter().map(|row| (row.uuid.as_str(), row)).collect();
    let is_sound = |row: &&Row| {
        let size = row.size;
        let is_box = size.is_finite() && size.min_element() > 0.0 && size.max_element() <= SIZE_MAX;
        is_box && row.centre.is_finite() && row.yaw.is_finite()
    };
    rows.iter()
        .filter(is_sound)
        .map(|row| {
            let sibling = row.sibling.as_deref().and_then(|id| by_uuid.get(id));
            let is_second = row.sensor == SECOND;
            Cuboid {
                // Both boxes of an object have the name of the first.
                track: sibling.filter(|_| is_second).map_or(&row.uuid, |first| &first.uuid).clone(),
                label: row.label.clone(),
                centre: row.centre - origin,
                size: DVec3::new(row.size.y, row.size.x, row.size.z),
                // PandaSet measures from the y axis: the heading is (-sin yaw, cos yaw).
                yaw: row.yaw + FRAC_PI_2,
                sensor: sibling.map(|_| u8::from(is_second)),
                id: row.uuid.clone(),
            }
        })
        .collect()
}
