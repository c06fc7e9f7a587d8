//! Exact labels of synthetic streets, in tables beside the layout of PandaSet: `truth/points/NN.pkl.gz`.
//!
//! | column | type | meaning |
//! |---|---|---|
//! | `flow.x`, `flow.y`, `flow.z` | f8 | displacement of the surface over the next 0.1 s, metres, world |
//! | `instance` | i8 | 0: no object; otherwise the object's number in `truth/actors.json` |
//! | `class` | i8 | index of the [`ObjectClass`]: 0 background, 1 car, 2 other vehicle, 3 pedestrian, 4 wheeled |
//! | `semantic` | i8 | as in `annotations/semseg` |

use std::path::Path;

use gs_base::counted;
use gs_datasets::DatasetError;

use super::names;
use crate::pickle::table::{self, Table};
use crate::pickle::value::PickleError;
use crate::sweep::{Labels, ObjectClass};

/// Names of the columns, in the order of the file.
pub const COLUMNS: [&str; 6] = ["flow.x", "flow.y", "flow.z", "instance", "class", "semantic"];

/// The name of an object in [`Labels::tracks`], and of its cuboids.
pub fn track(instance: u32) -> String {
    format!("actor-{instance:03}")
}

/// The labels of the points in `kept` of a sweep with `count` rows; `None` where there is no file.
pub(crate) fn read(sequence: &Path, stem: &str, count: usize, kept: &[usize]) -> Result<Option<Labels>, DatasetError> {
    let Some(path) = names::pickle(&sequence.join(names::TRUTH_POINTS), stem) else { return Ok(None) };
    let columns = table::read(&path, columns)?;
    if columns[0].len() != count {
        let expected = format!("{}, as the sweep has", counted(count, "row"));
        return Err(DatasetError::malformed(&path, "the table", expected, columns[0].len().to_string()));
    }
    let [x, y, z, instance, class, semantic] = &columns;
    let mut numbers: Vec<u32> = kept.iter().map(|i| instance[*i] as u32).filter(|number| *number > 0).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let place = |number: f64| numbers.binary_search(&(number as u32)).map_or(0, |place| place as u32 + 1);
    let class_of = |number: f64| ObjectClass::ALL.get(number as usize).copied().unwrap_or_default();
    Ok(Some(Labels {
        class: kept.iter().map(|i| class_of(class[*i])).collect(),
        instance: kept.iter().map(|i| place(instance[*i])).collect(),
        tracks: numbers.iter().map(|number| track(*number)).collect(),
        flow: kept.iter().map(|i| Some([x[*i] as f32, y[*i] as f32, z[*i] as f32])).collect(),
        semantic: kept.iter().map(|i| semantic[*i] as u8).collect(),
    }))
}

fn columns(table: &Table<'_, '_>) -> Result<[Vec<f64>; 6], PickleError> {
    let mut columns: [Vec<f64>; 6] = Default::default();
    for (column, name) in columns.iter_mut().zip(COLUMNS) {
        *column = table.numbers(name)?;
    }
    Ok(columns)
}
