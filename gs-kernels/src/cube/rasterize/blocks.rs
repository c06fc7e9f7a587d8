//! The eight blocks of 8 x 4 pixels of a tile, and which Gaussians reach them.
//!
//! Thirty-two consecutive units own a block, or in the backward pass four blocks below each other, so whether a
//! Gaussian is skipped is one decision for all of them. The test is that of the tiles, with its slack: a pair is
//! skipped only where alpha is under the cut-off.

use cubecl::prelude::*;

use super::attributes::Quad;
use crate::cube::intersect::{CutOff, touches};

/// Pixels of a block along x.
pub(super) const WIDE: u32 = 8;
/// Pixels of a block along y.
pub(super) const HIGH: u32 = 4;
/// Units that own a block: its pixels.
pub(super) const UNITS: u32 = WIDE * HIGH;
/// Blocks of a tile along x.
pub(super) const ACROSS: u32 = 2;
/// Blocks of a tile.
pub(super) const BLOCKS: u32 = 8;

/// Whether the staged Gaussian whose row begins at quad `row` reaches the block whose first pixel's centre is (`x`,
/// `y`).
#[cube]
pub(super) fn reaches(staged: &Shared<[Quad]>, row: usize, x: f32, y: f32) -> bool {
    let (place, cut, rest) = (staged[row], staged[row + 1], staged[row + 2]);
    let (left, top) = (x - place.extract(0usize), y - place.extract(1usize));
    let (d1, l, d2) = (place.extract(2usize), place.extract(3usize), cut.extract(0usize));
    let cut = CutOff { k: cut.extract(2usize), reach_y: cut.extract(3usize), turn: rest.extract(0usize) };
    touches(d1, l, d2, cut, left, top, comptime!((WIDE - 1) as f32), comptime!((HIGH - 1) as f32))
}

/// The blocks that the staged Gaussian reaches, a bit each, of the tile whose first pixel is (`left`, `top`).
#[cube]
pub(super) fn blocks_reached(staged: &Shared<[Quad]>, row: usize, left: u32, top: u32) -> u32 {
    let mut reached = 0u32;
    #[unroll]
    for of in 0..BLOCKS {
        let x = f32::cast_from(left + comptime!(of % ACROSS * WIDE)) + 0.5f32;
        let y = f32::cast_from(top + comptime!(of / ACROSS * HIGH)) + 0.5f32;
        reached |= select(reaches(staged, row, x, y), comptime!(1u32 << of).runtime(), 0u32);
    }
    reached
}
