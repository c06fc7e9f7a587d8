//! Tile intersections: the Gaussians that touch each tile, in depth order.
//!
//! The test is exact: the part of the cut-off ellipse inside a row of tiles is convex, so the pixels it can reach in
//! that row are one interval, known in closed form. Gaussians are sorted by depth once, then distributed to the tiles
//! in that order, so no list of (tile, depth) keys is ever sorted.

mod lists;
mod spans;

pub use lists::{IntersectionSlices, Intersections, intersect};
pub(super) use spans::spans_of;
#[cfg(feature = "cube")]
pub(crate) use spans::{PIXEL_SLACK, SLACK};
