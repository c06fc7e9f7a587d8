//! Version 2: a Parquet file for each component of a segment, `COMPONENT/NAME.parquet`.
//!
//! | file | holds |
//! |---|---|
//! | `keys.rs` | rows by time and sensor |
//! | `describe.rs` | poses, calibrations and frames |
//! | `read.rs` | range images, images and boxes |

mod describe;
mod keys;
mod read;

use std::path::{Path, PathBuf};

use gs_datasets::DatasetError;

use self::keys::Keys;
use super::names::PARQUET;
use super::parquet::table::Table;

/// A component: its table and the rows by time and sensor.
#[derive(Debug)]
struct Component {
    table: Table,
    keys: Keys,
}

/// The files of a segment.
#[derive(Debug)]
pub(crate) struct Modular {
    root: PathBuf,
    name: String,
    lidar: Component,
    lidar_pose: Component,
    images: Option<Component>,
    boxes: Option<Component>,
}

impl Modular {
    /// The file with images.
    pub fn images(&self) -> PathBuf {
        file(&self.root, "camera_image", &self.name)
    }

    /// The file with range images.
    pub fn lidar(&self) -> PathBuf {
        self.lidar.table.path().to_path_buf()
    }
}

/// The file of a component.
fn file(root: &Path, component: &str, name: &str) -> PathBuf {
    root.join(component).join(format!("{name}{PARQUET}"))
}

impl Component {
    /// Reads metadata and keys. `sensor`: the column with the sensor, and names of sensors.
    fn open(root: &Path, component: &str, name: &str, sensor: Option<(&str, &[&str])>) -> Result<Self, DatasetError> {
        let table = Table::open(&file(root, component, name))?;
        let keys = Keys::read(&table, true, sensor)?;
        Ok(Self { table, keys })
    }
}
