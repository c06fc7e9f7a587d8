//! Tile intersections: the Gaussians that touch each tile, in depth order.
//!
//! The test is the exact one of [`crate::cpu::intersect`]: in a row of tiles the part of the cut-off ellipse is convex,
//! so the pixels it can reach there are one interval. Steps: count the tiles of every Gaussian; sort the Gaussians by
//! depth (stable, so that ties keep their index order); emit their pairs in that order; sort the pairs by tile (stable
//! again, so that a tile's list is in depth order); find the offset of each tile. One number is read back, the number
//! of pairs, because it sizes the buffers.

mod instants;
mod lists;
mod spans;

pub use instants::{FoundInstants, InstantRows, intersect_instants};
pub use lists::{Found, Intersections, PAIRS_OF_A_UNIT, intersect};
pub(in crate::cube) use spans::{CutOff, cut_off, touches};
