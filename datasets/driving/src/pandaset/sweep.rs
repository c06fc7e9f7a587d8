//! Pickled sweeps.

use std::path::Path;

use glam::DVec3;
use gs_base::counted;
use gs_datasets::DatasetError;

use super::{cuboids, names, truth};
use crate::boxes;
use crate::description::Frame;
use crate::gzip;
use crate::pickle::machine::parse;
use crate::pickle::table::Table;
use crate::pickle::value::PickleError;
use crate::sweep::{RANGE_MAX, Sweep};

/// Longest time between two frames whose boxes are compared for flow, seconds: one frame may be missing.
const PAIR_MAX: f64 = 0.25;

/// The columns of a sweep.
struct Rows {
    points: Vec<DVec3>,
    times: Vec<f64>,
    intensity: Vec<f64>,
    sensor: Vec<f64>,
}

/// The sweep of a frame, with labels by its boxes, or exact ones where the sequence has them; `next` is the frame
/// behind it.
pub(crate) fn read(sequence: &Path, frame: &Frame, next: Option<&Frame>, origin: DVec3) -> Result<Sweep, DatasetError> {
    let folder = sequence.join(names::LIDAR);
    let missing =
        || DatasetError::read(&folder.join(format!("{}.pkl.gz", frame.name)), std::io::ErrorKind::NotFound.into());
    let path = names::pickle(&folder, &frame.name).ok_or_else(missing)?;
    let bytes = gzip::read(&path)?;
    let rows = parse(&bytes).and_then(|tree| rows(&Table::of(&tree)?, frame.time));
    let rows = rows.map_err(|error| DatasetError::malformed(&path, error.location, error.expected, error.found))?;
    drop(bytes);
    let ego = frame.ego.w_axis.truncate();
    let kept: Vec<usize> = (0..rows.points.len())
        .filter(|index| {
            let near = (rows.points[*index] - origin).distance(ego) <= RANGE_MAX;
            near && rows.times[*index].is_finite()
        })
        .collect();
    let mut sweep = Sweep {
        points: kept.iter().map(|i| (rows.points[*i] - origin).as_vec3().to_array()).collect(),
        times: kept.iter().map(|i| rows.times[*i]).collect(),
        intensity: kept.iter().map(|i| rows.intensity[*i] as f32).collect(),
        sensor: kept.iter().map(|i| rows.sensor[*i] as u8).collect(),
        labels: None,
        left_out: rows.points.len() - kept.len(),
    };
    let count = rows.points.len();
    if let Some(labels) = truth::read(sequence, &frame.name, count, &kept)? {
        sweep.labels = Some(labels);
        return Ok(sweep);
    }
    if let Some(boxes) = cuboids::read(sequence, &frame.name, origin)? {
        let next = next.filter(|next| next.time - frame.time <= PAIR_MAX);
        let later = match next {
            Some(next) => cuboids::read(sequence, &next.name, origin)?.map(|boxes| (boxes, next.time - frame.time)),
            None => None,
        };
        let later = later.as_ref().map(|(boxes, interval)| (&boxes[..], *interval));
        sweep.labels = Some(boxes::labels(&sweep.points, &sweep.sensor, &boxes, later));
    }
    if let Some(labels) = &mut sweep.labels
        && let Some(path) = names::pickle(&sequence.join(names::SEMSEG), &frame.name)
    {
        let classes = column(&path, "class")?;
        if classes.len() != count {
            let expected = format!("{}, as the sweep has", counted(count, "row"));
            return Err(DatasetError::malformed(&path, "the table", expected, classes.len().to_string()));
        }
        labels.semantic = kept.iter().map(|index| classes[*index] as u8).collect();
    }
    Ok(sweep)
}

/// One column of numbers of a pickled table.
pub(crate) fn column(path: &Path, name: &str) -> Result<Vec<f64>, DatasetError> {
    let bytes = gzip::read(path)?;
    let numbers = parse(&bytes).and_then(|tree| Table::of(&tree)?.numbers(name));
    numbers.map_err(|error| DatasetError::malformed(path, error.location, error.expected, error.found))
}

fn rows(table: &Table<'_, '_>, time: f64) -> Result<Rows, PickleError> {
    let [x, y, z] = [table.numbers("x")?, table.numbers("y")?, table.numbers("z")?];
    // Re-packed files may have positions alone.
    let or = |name: &str, value: f64| match table.cells(name) {
        Some(_) => table.numbers(name),
        None => Ok(vec![value; table.rows]),
    };
    Ok(Rows {
        points: x.iter().zip(&y).zip(&z).map(|((x, y), z)| DVec3::new(*x, *y, *z)).collect(),
        times: or("t", time)?,
        intensity: or("i", 0.0)?,
        sensor: or("d", 0.0)?,
    })
}
