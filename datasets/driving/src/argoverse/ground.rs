//! The ground of a log by its map: a raster of heights, `map/*_ground_height_surface____*.npy`, and its place in the
//! city, `map/*___img_Sim2_city.json`.

use std::path::{Path, PathBuf};

use glam::{DMat2, DVec2, DVec3};
use gs_base::guarded::{DESCRIPTION_MAX, read_to_string};
use gs_base::npy;
use gs_datasets::DatasetError;
use serde::Deserialize;

/// Points up to this above the raster are ground, metres (av2-api, `GROUND_HEIGHT_THRESHOLD_M`).
const THICKNESS: f64 = 0.3;

/// From the city's plane to the raster: `scale (rotation p + shift)`.
#[derive(Deserialize)]
struct Similarity {
    #[serde(rename = "R")]
    rotation: [f64; 4],
    #[serde(rename = "t")]
    shift: [f64; 2],
    #[serde(rename = "s")]
    scale: f64,
}

/// The ground of a log by its map.
pub struct MapGround {
    heights: npy::Array,
    place: Similarity,
    /// The position in the city that is (0, 0, 0) in the log, metres.
    origin: DVec3,
}

impl std::fmt::Debug for MapGround {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("MapGround").field("shape", &self.heights.shape).finish_non_exhaustive()
    }
}

impl MapGround {
    /// Reads the raster of a log.
    ///
    /// # Errors
    /// When a file is missing or broken.
    pub(crate) fn read(log: &Path, origin: DVec3) -> Result<Self, DatasetError> {
        let (raster, place) =
            (file(log, "_ground_height_surface____", ".npy")?, file(log, "___img_Sim2_city", ".json")?);
        let heights = npy::read(&raster)?;
        if heights.shape.len() != 2 {
            let found = format!("{:?}", heights.shape);
            return Err(DatasetError::malformed(&raster, "the array", "rows and columns of heights", found));
        }
        let text = read_to_string(&place, DESCRIPTION_MAX)?;
        let place = serde_json::from_str(&text).map_err(|error| {
            DatasetError::malformed(&place, "the file", "R, t and s of a similarity", error.to_string())
        })?;
        Ok(Self { heights, place, origin })
    }

    /// Whether a point of the log's world is on the ground or below it, as Argoverse 2's protocols of scene flow leave
    /// points out; no point beyond the raster is.
    pub fn has(&self, point: [f32; 3]) -> bool {
        let point = DVec3::from_array(point.map(f64::from)) + self.origin;
        let Similarity { rotation: [a, b, c, d], shift, scale } = self.place;
        let pixel = scale * (DMat2::from_cols_array(&[a, c, b, d]) * point.truncate() + DVec2::from_array(shift));
        let [rows, columns] = [self.heights.shape[0], self.heights.shape[1]];
        // Towards zero, as the data set's own program.
        let (row, column) = (pixel.y as i64, pixel.x as i64);
        let is_inside = (0..rows as i64).contains(&row) && (0..columns as i64).contains(&column);
        is_inside
            && pixel.is_finite()
            && point.z - self.heights.values[row as usize * columns + column as usize] <= THICKNESS
    }
}

/// The first file of the map by name that has these parts in its name.
fn file(log: &Path, middle: &str, end: &str) -> Result<PathBuf, DatasetError> {
    let folder = log.join("map");
    let entries = std::fs::read_dir(&folder).map_err(|source| DatasetError::read(&folder, source))?;
    let is_it = |path: &PathBuf| {
        path.file_name().and_then(|name| name.to_str()).is_some_and(|name| name.contains(middle) && name.ends_with(end))
    };
    let found = entries.flatten().map(|entry| entry.path()).filter(is_it).min();
    found.ok_or_else(|| DatasetError::malformed(&folder, "the folder", format!("a file *{middle}*{end}"), "none"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A raster of 2 x 3 heights with pixels of half a metre, 10 m beside the city's origin.
    #[test]
    fn points_near_the_raster_are_ground() {
        let heights = npy::Array { shape: vec![2, 3], values: vec![1.0, 2.0, f64::NAN, 4.0, 5.0, 6.0] };
        let place = Similarity { rotation: [1.0, 0.0, 0.0, 1.0], shift: [-10.0, 0.0], scale: 2.0 };
        let ground = MapGround { heights, place, origin: DVec3::new(10.0, 0.0, 0.0) };
        let has = |x: f32, y: f32, z: f32| ground.has([x - 10.0, y, z]);
        assert!(has(10.1, 0.1, 1.29) && !has(10.1, 0.1, 1.31) && has(10.1, 0.1, -5.0));
        assert!(has(10.6, 0.9, 5.2) && !has(10.6, 0.9, 5.4));
        assert!(!has(11.2, 0.1, 0.0), "a height that is not known");
        assert!(!has(12.0, 0.1, 0.0) && !has(10.1, 1.1, 0.0) && !has(9.4, 0.1, 0.0), "beyond the raster");
    }

    #[test]
    fn a_missing_map_is_said() {
        let folder = tempfile::tempdir().expect("a folder");
        assert!(MapGround::read(folder.path(), DVec3::ZERO).is_err());
        std::fs::create_dir(folder.path().join("map")).expect("made");
        let said = MapGround::read(folder.path(), DVec3::ZERO).expect_err("no raster").to_string();
        assert!(said.contains("_ground_height_surface____"), "{said}");
    }
}
