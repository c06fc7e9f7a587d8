//! Pickled sweeps.

use std::path::Path;

use glam::DVec3;
use gs_base::counted;
use gs_datasets::DatasetError;

use super::{cuboids, names, truth};
use crate::boxes::{self, Boxed};
use crate::description::Frame;
use crate::pickle::table::{self, Table};
use crate::pickle::value::PickleError;
use crate::sweep::{RANGE_MAX, Sweep};

/// The columns of a sweep.
struct Rows {
    points: Vec<DVec3>,
    times: Vec<f64>,
    intensity: Vec<f64>,
    sensor: Vec<f64>,
}

/// The sweep of a frame, and the rows of the file that its points are of, with their number.
struct Read {
    sweep: Sweep,
    kept: Vec<usize>,
    count: usize,
}

/// The sweep of a frame.
pub(crate) fn read(sequence: &Path, frame: &Frame, origin: DVec3) -> Result<Sweep, DatasetError> {
    read_rows(sequence, frame, origin).map(|read| read.sweep)
}

fn read_rows(sequence: &Path, frame: &Frame, origin: DVec3) -> Result<Read, DatasetError> {
    let folder = sequence.join(names::LIDAR);
    let missing =
        || DatasetError::read(&folder.join(format!("{}.pkl.gz", frame.name)), std::io::ErrorKind::NotFound.into());
    let path = names::pickle(&folder, &frame.name).ok_or_else(missing)?;
    let rows = table::read(&path, |table| rows(table, frame.time))?;
    let ego = frame.ego.w_axis.truncate();
    let kept: Vec<usize> = (0..rows.points.len())
        .filter(|index| {
            let near = (rows.points[*index] - origin).distance(ego) <= RANGE_MAX;
            near && rows.times[*index].is_finite()
        })
        .collect();
    let sweep = Sweep {
        points: kept.iter().map(|i| (rows.points[*i] - origin).as_vec3().to_array()).collect(),
        times: kept.iter().map(|i| rows.times[*i]).collect(),
        intensity: kept.iter().map(|i| rows.intensity[*i] as f32).collect(),
        sensor: kept.iter().map(|i| rows.sensor[*i] as u8).collect(),
        labels: None,
        left_out: rows.points.len() - kept.len(),
    };
    Ok(Read { sweep, kept, count: rows.points.len() })
}

/// The sweep of a frame with labels by its boxes, or exact ones where the sequence has them; `next` is the frame behind
/// it.
pub(crate) fn labelled(
    sequence: &Path,
    frame: &Frame,
    next: Option<&Frame>,
    origin: DVec3,
) -> Result<Sweep, DatasetError> {
    let Read { mut sweep, kept, count } = read_rows(sequence, frame, origin)?;
    if let Some(labels) = truth::read(sequence, &frame.name, count, &kept)? {
        sweep.labels = Some(labels);
        return Ok(sweep);
    }
    if let Some(boxes) = cuboids::read(sequence, &frame.name, origin)? {
        let later = || {
            let Some(next) = next else { return Ok(None) };
            let Some(boxes) = cuboids::read(sequence, &next.name, origin)? else { return Ok(None) };
            let sweep = if next.has_sweep { read(sequence, next, origin)? } else { Sweep::default() };
            Ok(Some(Boxed { boxes, sweep }))
        };
        sweep.labels = Some(boxes::labels(&sweep, &boxes, next.map(|next| next.time - frame.time), later)?);
    }
    if let Some(labels) = &mut sweep.labels
        && let Some(path) = names::pickle(&sequence.join(names::SEMSEG), &frame.name)
    {
        let classes = table::read(&path, |table| table.numbers("class"))?;
        if classes.len() != count {
            let expected = format!("{}, as the sweep has", counted(count, "row"));
            return Err(DatasetError::malformed(&path, "the table", expected, classes.len().to_string()));
        }
        labels.semantic = kept.iter().map(|index| classes[*index] as u8).collect();
    }
    Ok(sweep)
}

fn rows(table: &Table<'_, '_>, time: f64) -> Result<Rows, PickleError> {
    let points = table.vectors(["x", "y", "z"])?;
    // Re-packed files may have positions alone.
    let or = |name: &str, value: f64| match table.cells(name) {
        Some(_) => table.numbers(name),
        None => Ok(vec![value; table.rows]),
    };
    Ok(Rows { points, times: or("t", time)?, intensity: or("i", 0.0)?, sensor: or("d", 0.0)? })
}
