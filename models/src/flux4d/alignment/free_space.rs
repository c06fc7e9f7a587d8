//! Where a sweep's rays passed: an image of ranges around the LiDAR.

use std::f64::consts::{PI, TAU};

use super::AlignedSweep;

/// Columns of the image: 0.4 degrees, two steps of a spinning LiDAR.
const COLUMNS: usize = 900;
/// Rows of the image: 0.5 degrees, about the distance of two beams.
const ROWS: usize = 360;
/// A return this much behind a point, metres, is not of the point's surface: the ego vehicle's motion within a sweep is
/// not in the image, and a surface at a slant has that much depth in a cell.
const BEHIND: f64 = 0.7;
/// The same as a share of the range.
const BEHIND_SHARE: f64 = 0.02;

/// Nearest returns by direction.
#[derive(Debug)]
pub struct RangeImage {
    origin: [f64; 3],
    /// `[ROWS, COLUMNS]`, metres; infinite where nothing returned.
    nearest: Vec<f32>,
}

impl RangeImage {
    /// Of the returns of a sweep.
    pub fn new(sweep: &AlignedSweep) -> Self {
        let mut image = Self { origin: sweep.origin, nearest: vec![f32::INFINITY; ROWS * COLUMNS] };
        for point in sweep.points {
            let ([row, column], range) = image.place(point);
            let slot = &mut image.nearest[row * COLUMNS + column];
            *slot = slot.min(range as f32);
        }
        image
    }

    fn place(&self, point: &[f32; 3]) -> ([usize; 2], f64) {
        let [x, y, z] = [0, 1, 2].map(|axis| f64::from(point[axis]) - self.origin[axis]);
        let across = x.hypot(y);
        let (azimuth, elevation) = (y.atan2(x) + PI, z.atan2(across) + 0.5 * PI);
        let column = ((azimuth / TAU * COLUMNS as f64) as usize).min(COLUMNS - 1);
        let row = ((elevation / PI * ROWS as f64) as usize).min(ROWS - 1);
        ([row, column], across.hypot(z))
    }

    /// Whether rays passed through the place of a point: in its direction and those next to it something returned, and
    /// all of it from behind.
    pub fn passed(&self, point: &[f32; 3]) -> bool {
        let ([row, column], range) = self.place(point);
        let rows = row.saturating_sub(1)..(row + 2).min(ROWS);
        let near = rows.flat_map(|row| (0..3).map(move |step| row * COLUMNS + (column + COLUMNS - 1 + step) % COLUMNS));
        let nearest = near.map(|slot| self.nearest[slot]).fold(f32::INFINITY, f32::min);
        nearest.is_finite() && f64::from(nearest) > range * (1.0 + BEHIND_SHARE) + BEHIND
    }
}
