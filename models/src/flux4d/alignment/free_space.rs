//! Where a sweep's rays passed: an image of ranges around the LiDAR.

use std::f64::consts::{PI, TAU};

use super::AlignedSweep;

/// Columns of the image: 0.4 degrees, two steps of a spinning LiDAR.
const COLUMNS: usize = 900;
/// Rows of the image: 0.5 degrees, about the distance of two beams.
const ROWS: usize = 360;
/// Rows to the next beam, at most: 1.5 degrees, so that beams above and below a car 40 m away would meet it.
const BEAM_ROWS: usize = 3;
/// A return this much behind a point, metres, is not of the point's surface: the ego vehicle's motion within a sweep is
/// not in the image, and a surface at a slant has that much depth in a cell.
const BEHIND: f64 = 0.7;
/// The same as a share of the range.
const BEHIND_SHARE: f64 = 0.02;
/// A return this much before a place, metres, hides it: less may be the near side of the body at the place.
const BEFORE: f64 = 2.5;

/// Returns by direction.
#[derive(Debug)]
pub struct RangeImage {
    origin: [f64; 3],
    /// Nearest return above the ground, `[ROWS, COLUMNS]`, metres; infinite where there is none.
    nearest: Vec<f32>,
    /// Whether anything returned in a row, and in a column.
    rows: Vec<bool>,
    columns: Vec<bool>,
    /// The lowest and the highest row with a return; `None` without any.
    span: Option<[usize; 2]>,
}

impl RangeImage {
    /// Of the returns of a sweep; `stands` says which are above the ground.
    pub fn new(sweep: &AlignedSweep, stands: impl Fn(usize) -> bool) -> Self {
        let nearest = vec![f32::INFINITY; ROWS * COLUMNS];
        let (rows, columns) = (vec![false; ROWS], vec![false; COLUMNS]);
        let mut image = Self { origin: sweep.origin, nearest, rows, columns, span: None };
        for (index, point) in sweep.points.iter().enumerate() {
            let ([row, column], range) = image.place(point);
            (image.rows[row], image.columns[column]) = (true, true);
            if stands(index) {
                let slot = &mut image.nearest[row * COLUMNS + column];
                *slot = slot.min(range as f32);
            }
        }
        let (low, high) = (image.rows.iter().position(|any| *any), image.rows.iter().rposition(|any| *any));
        image.span = low.zip(high).map(<[usize; 2]>::from);
        image
    }

    fn place(&self, point: &[f32; 3]) -> ([usize; 2], f64) {
        let [x, y, z] = [0, 1, 2].map(|axis| f64::from(point[axis]) - self.origin[axis]);
        let across = (x * x + y * y).sqrt();
        let (azimuth, elevation) = (y.atan2(x) + PI, z.atan2(across) + 0.5 * PI);
        let column = ((azimuth / TAU * COLUMNS as f64) as usize).min(COLUMNS - 1);
        let row = ((elevation / PI * ROWS as f64) as usize).min(ROWS - 1);
        ([row, column], (across * across + z * z).sqrt())
    }

    /// Whether rays passed through the place of a point: in its direction and those next to it nothing above the ground
    /// returned from there or before, though there are beams above and below.
    ///
    /// A ray into the sky does not return, and passed as well. The road before a car 40 m away is as low as its bumper
    /// in the cells of the image, and says nothing of the car.
    pub fn passed(&self, point: &[f32; 3]) -> bool {
        let ([row, column], range) = self.place(point);
        let columns = around(column);
        let scanned = self.is_between_beams(row) && columns.clone().any(|column| self.columns[column]);
        let limit = range * (1.0 + BEHIND_SHARE) + BEHIND;
        let rows = row.saturating_sub(1)..(row + 2).min(ROWS);
        let mut near = rows.flat_map(|row| columns.clone().map(move |column| row * COLUMNS + column));
        scanned && near.all(|slot| f64::from(self.nearest[slot]) > limit)
    }

    /// Whether something above the ground hides a place from the LiDAR.
    pub fn hides(&self, point: &[f32; 3]) -> bool {
        let ([row, column], range) = self.place(point);
        let rows = row.saturating_sub(1)..(row + 2).min(ROWS);
        rows.map(|row| self.nearest[row * COLUMNS + column]).any(|nearest| f64::from(nearest) < range - BEFORE)
    }

    /// Whether a point is in the LiDAR's field of view: one that looks ahead sees nothing behind it.
    pub fn covers(&self, point: &[f32; 3]) -> bool {
        let ([row, column], _) = self.place(point);
        let is_within = self.span.is_some_and(|[low, high]| (low..=high).contains(&row));
        is_within && around(column).any(|column| self.columns[column])
    }

    /// Position of the LiDAR, metres.
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    fn is_between_beams(&self, row: usize) -> bool {
        let below = (row.saturating_sub(BEAM_ROWS)..=row).find(|row| self.rows[*row]);
        let above = (row..(row + BEAM_ROWS + 1).min(ROWS)).rev().find(|row| self.rows[*row]);
        below.zip(above).is_some_and(|(below, above)| below < above)
    }
}

/// A column and the two beside it.
fn around(column: usize) -> impl Iterator<Item = usize> + Clone {
    (0..3).map(move |step| (column + COLUMNS - 1 + step) % COLUMNS)
}
