//! The tiles that a Gaussian touches, row of tiles by row of tiles, in closed form.

use cubecl::prelude::*;

use crate::constants;
use crate::constants::TILE;
use crate::cpu::intersect::{PIXEL_SLACK, SLACK};
use crate::cube::buffer::UNITS;
use crate::cube::math::finite;
use crate::cube::rows::{DeviceRow, read_row};

const ALPHA_MIN: f32 = constants::ALPHA_MIN as f32;
const FEATURE_MAX: f32 = constants::FEATURE_MAX as f32;
const SLACK_FACTOR: f32 = (1.0 + SLACK.0) as f32;
const SLACK_OFFSET: f32 = SLACK.1 as f32;
const STRIP_SLACK: f32 = PIXEL_SLACK as f32;
const CENTRE_SLACK: f32 = (PIXEL_SLACK + 0.5) as f32;
const EDGE: f32 = TILE as f32;
const TILE_U32: u32 = TILE as u32;

/// A key behind every depth.
const NO_DEPTH: u32 = u32::MAX;

/// Pixels or tiles `first..=last`; none when `first > last`.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(super) struct Range {
    pub(super) first: u32,
    pub(super) last: u32,
}

/// Tiles whose pixel centres can lie in `low..=high`, with slack, along a side of `size` pixels.
#[cube]
fn tile_range(low: f32, high: f32, size: f32) -> Range {
    let first = (low - CENTRE_SLACK).ceil();
    let last = (high + CENTRE_SLACK - 1.0f32).floor();
    let some = finite(low) && finite(high) && low <= high && first < size && last >= 0.0f32 && first <= last;
    let first = select(some && first > 0.0f32, first, 0.0f32);
    let last = select(some && last >= 0.0f32, select(last < size - 1.0f32, last, size - 1.0f32), 0.0f32);
    Range {
        first: select(some, u32::cast_from(first) / TILE_U32, 1u32),
        last: select(some, u32::cast_from(last) / TILE_U32, 0u32),
    }
}

/// The cut-off ellipse `d1 (dx + l dy)^2 + d2 dy^2 <= k` about the mean and the tile rows it spans.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(super) struct Ellipse {
    pub(super) k: f32,
    pub(super) reach_y: f32,
    /// `dy` of the rightmost point.
    pub(super) turn: f32,
    pub(super) rows: Range,
}

#[cube]
pub(super) fn ellipse(row: DeviceRow, opacity: f32, height: f32) -> Ellipse {
    let cut = cut_off(row, opacity);
    let rows = tile_range(row.mean_y - cut.reach_y, row.mean_y + cut.reach_y, height);
    Ellipse { k: cut.k, reach_y: cut.reach_y, turn: cut.turn, rows }
}

/// The size of the ellipse `d1 (dx + l dy)^2 + d2 dy^2 <= k` beyond which alpha is under the cut-off, with slack for
/// rounding.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(in crate::cube) struct CutOff {
    pub(in crate::cube) k: f32,
    /// Largest `dy`.
    pub(in crate::cube) reach_y: f32,
    /// `dy` of the rightmost point.
    pub(in crate::cube) turn: f32,
}

#[cube]
pub(in crate::cube) fn cut_off(row: DeviceRow, opacity: f32) -> CutOff {
    let k = 2.0f32 * (opacity / ALPHA_MIN).ln() * SLACK_FACTOR + SLACK_OFFSET;
    let reach_y = (k / row.d2).sqrt();
    // Cxy / sqrt(Cxx) sqrt(k), with Cxy = -l / d2 and Cxx = 1 / d1 + l^2 / d2.
    let cxx = 1.0f32 / row.d1 + row.l * row.l / row.d2;
    let turn = -(row.l / row.d2) * (k / cxx).sqrt();
    CutOff { k, reach_y, turn }
}

/// Whether the ellipse, about its mean, touches the rectangle of pixel centres `left..=left + wide`, `top..=top +
/// high`; with the slack of the tiles, so that no pixel whose alpha reaches the cut-off is left out.
#[cube]
pub(in crate::cube) fn touches(
    d1: f32,
    l: f32,
    d2: f32,
    cut: CutOff,
    left: f32,
    top: f32,
    #[comptime] wide: f32,
    #[comptime] high: f32,
) -> bool {
    let low = select(top > -cut.reach_y, top, -cut.reach_y);
    let high = select(top + high < cut.reach_y, top + high, cut.reach_y);
    let first = edge(d1, l, d2, cut.k, held(-cut.turn, low, high), -1.0f32);
    let last = edge(d1, l, d2, cut.k, held(cut.turn, low, high), 1.0f32);
    low <= high + STRIP_SLACK && first <= left + wide + STRIP_SLACK && last >= left - STRIP_SLACK
}

/// Right end, as `dx`, of the ellipse at `dy` (`side` 1) or its left end (`side` -1).
#[cube]
fn edge(d1: f32, l: f32, d2: f32, k: f32, dy: f32, side: f32) -> f32 {
    let rest = k - d2 * dy * dy;
    let rest = select(rest > 0.0f32, rest, 0.0f32) / d1;
    side * rest.sqrt() - l * dy
}

/// Columns of tiles that the ellipse touches in tile row `tile_row`. The rightmost point in the strip is the whole
/// ellipse's rightmost point clamped to the strip; likewise on the left.
#[cube]
pub(super) fn columns_in(row: DeviceRow, ellipse: Ellipse, tile_row: u32, width: f32, height: f32) -> Range {
    let top = f32::cast_from(tile_row) * EDGE + 0.5f32;
    let below = top + EDGE - 1.0f32;
    let bottom = select(below < height - 0.5f32, below, height - 0.5f32);
    let reach = ellipse.reach_y;
    let low = select(top - row.mean_y > -reach, top - row.mean_y, -reach);
    let high = select(bottom - row.mean_y < reach, bottom - row.mean_y, reach);
    let right_at = held(ellipse.turn, low, high);
    let left_at = held(-ellipse.turn, low, high);
    let left = row.mean_x + edge(row.d1, row.l, row.d2, ellipse.k, left_at, -1.0f32);
    let right = row.mean_x + edge(row.d1, row.l, row.d2, ellipse.k, right_at, 1.0f32);
    let range = tile_range(left, right, width);
    let touched = low <= high + STRIP_SLACK;
    Range { first: select(touched, range.first, 1u32), last: select(touched, range.last, 0u32) }
}

/// `value` raised to `low`, then lowered to `high`, in the order of the CPU twin.
#[cube]
fn held(value: f32, low: f32, high: f32) -> f32 {
    let raised = select(value > low, value, low);
    select(raised < high, raised, high)
}

/// One unit per Gaussian: counts its tiles and writes its depth as a key that sorts as an unsigned number.
#[cube(launch_unchecked)]
pub(super) fn tile_count_kernel(
    projected: &[f32],
    opacities: &[f32],
    features: &[f32],
    counts: &mut [u32],
    keys: &mut [u32],
    ids: &mut [u32],
    count: u32,
    channels: u32,
    width: f32,
    height: f32,
) {
    let index = CUBE_POS * UNITS + UNIT_POS as usize;
    if index >= count as usize {
        terminate!();
    }
    let row = read_row(projected, index);
    let opacity = opacities[index];
    let mut usable =
        finite(row.radius) && row.radius > 0.0f32 && finite(opacity) && opacity >= ALPHA_MIN && finite(row.depth);
    let base = index * channels as usize;
    for channel in 0..channels {
        let feature = features[base + channel as usize];
        usable = usable && finite(feature) && feature.abs() < FEATURE_MAX;
    }
    let mut tiles = 0u32;
    if usable {
        let ellipse = ellipse(row, opacity, height);
        for tile_row in ellipse.rows.first..ellipse.rows.last + 1u32 {
            let columns = columns_in(row, ellipse, tile_row, width, height);
            tiles += columns.last + 1u32 - columns.first;
        }
    }
    counts[index] = tiles;
    let bits = u32::reinterpret(row.depth);
    let sign = bits >> 31u32;
    let ordered = select(sign == 0u32, bits | 0x8000_0000u32, !bits);
    keys[index] = select(tiles > 0u32, ordered, NO_DEPTH.runtime());
    ids[index] = index as u32;
}
