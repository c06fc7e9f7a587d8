//! Places that a sweep does not see: something nearer to the LiDAR hides them.
//!
//! A body that moves into a shadow has no points there, which says nothing against its motion.

use super::free_space::RangeImage;
use super::ground::Ground;
use super::plan::Extent;

/// Edge of the cells, metres: a car is several of them long; and most of them along an axis, where sweeps are far
/// apart.
const CELL: f64 = 1.0;
const CELLS_MAX: f64 = 1024.0;
/// Heights above the ground, metres, that must all be hidden: the bumper and the windows of a car. What is hidden to
/// the first alone shows its roof.
const HEIGHTS: [f32; 2] = [0.5, 1.2];

/// The places of an extent that a sweep does not see.
#[derive(Debug)]
pub struct Shadow {
    low: [f64; 2],
    cell: f64,
    size: [usize; 2],
    hidden: Vec<bool>,
}

impl Shadow {
    /// Of what a sweep's image shows, on the ground. Where the ground is unknown it is that under the LiDAR.
    pub fn new(image: &RangeImage, extent: Extent, ground: &Ground) -> Self {
        let (low, lengths) = extent.bounds();
        let cell = lengths.into_iter().fold(CELL, |cell, length| cell.max(length / CELLS_MAX));
        let size = lengths.map(|length| (length / cell).ceil() as usize);
        let [x, y, _] = image.origin();
        let under = ground.near(x, y);
        let hides = |place: usize| {
            let [x, y] = [place % size[0], place / size[0]].map(|step| (step as f64 + 0.5) * cell);
            let [x, y] = [low[0] + x, low[1] + y];
            let Some(height) = ground.at(x, y).or(under) else { return false };
            HEIGHTS.iter().all(|above| image.hides(&[x as f32, y as f32, height + above]))
        };
        let hidden = (0..size[0] * size[1]).map(hides).collect();
        Self { low, cell, size, hidden }
    }

    /// Whether the sweep does not see a place. What is beyond the extent is seen.
    pub fn hides(&self, [x, y]: [f64; 2]) -> bool {
        let (column, row) = ((x - self.low[0]) / self.cell, (y - self.low[1]) / self.cell);
        // Also refuses NaN.
        let inside = column >= 0.0 && row >= 0.0 && column < self.size[0] as f64 && row < self.size[1] as f64;
        inside && self.hidden[row as usize * self.size[0] + column as usize]
    }

    /// Whether the sweep does not see most of some places.
    pub fn hides_most(&self, places: impl Iterator<Item = [f64; 2]>) -> bool {
        let [all, hidden] = places.fold([0; 2], |[all, hidden], at| [all + 1, hidden + usize::from(self.hides(at))]);
        2 * hidden > all
    }
}
