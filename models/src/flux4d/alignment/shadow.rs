//! Places that a sweep does not see: something nearer to the LiDAR hides them, or it does not look there.
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
    grid: Extent,
    hidden: Vec<bool>,
}

impl Shadow {
    /// Of what a sweep's image shows, on the ground. Where the ground is unknown it is that under the LiDAR.
    pub fn new(image: &RangeImage, extent: Extent, ground: &Ground) -> Self {
        let grid = extent.coarser(CELL, CELLS_MAX);
        let [x, y, _] = image.origin();
        let under = ground.near(x, y);
        let hides = |[x, y]: [f64; 2]| {
            let Some(height) = ground.at(x, y).or(under) else { return false };
            HEIGHTS.iter().all(|above| {
                let point = [x as f32, y as f32, height + above];
                image.hides(&point) || !image.covers(&point)
            })
        };
        Self { grid, hidden: grid.middles().map(hides).collect() }
    }

    /// Whether the sweep does not see a place. What is beyond the extent is seen.
    pub fn hides(&self, [x, y]: [f64; 2]) -> bool {
        self.grid.place(x, y).is_some_and(|place| self.hidden[place])
    }
}
