//! The packed rows of [`crate::rows`] as the device reads and writes them.

use cubecl::prelude::*;

use crate::rows::PROJECTED;

/// A projected Gaussian; see [`crate::rows::ProjectedRow`].
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(crate) struct DeviceRow {
    /// Projected centre along x, pixels.
    pub mean_x: f32,
    /// Projected centre along y, pixels.
    pub mean_y: f32,
    /// Conic, per square pixel.
    pub d1: f32,
    /// Conic, no unit.
    pub l: f32,
    /// Conic, per square pixel.
    pub d2: f32,
    /// Camera z of the centre, scene units.
    pub depth: f32,
    /// Opacity factor of the anti-aliasing.
    pub compensation: f32,
    /// Bounding radius in pixels; 0 when culled.
    pub radius: f32,
}

/// Row `index` of a packed buffer.
#[cube]
pub(crate) fn read_row(rows: &[f32], index: usize) -> DeviceRow {
    let base = index * PROJECTED;
    DeviceRow {
        mean_x: rows[base],
        mean_y: rows[base + 1],
        d1: rows[base + 2],
        l: rows[base + 3],
        d2: rows[base + 4],
        depth: rows[base + 5],
        compensation: rows[base + 6],
        radius: rows[base + 7],
    }
}

/// Writes row `index` where `kept`, a row of zeros elsewhere.
#[cube]
pub(crate) fn write_row(rows: &mut [f32], index: usize, row: DeviceRow, kept: bool) {
    let base = index * PROJECTED;
    rows[base] = select(kept, row.mean_x, 0.0f32);
    rows[base + 1] = select(kept, row.mean_y, 0.0f32);
    rows[base + 2] = select(kept, row.d1, 0.0f32);
    rows[base + 3] = select(kept, row.l, 0.0f32);
    rows[base + 4] = select(kept, row.d2, 0.0f32);
    rows[base + 5] = select(kept, row.depth, 0.0f32);
    rows[base + 6] = select(kept, row.compensation, 0.0f32);
    rows[base + 7] = select(kept, row.radius, 0.0f32);
}

/// The radius alone of row `index`.
#[cube]
pub(crate) fn read_radius(rows: &[f32], index: usize) -> f32 {
    rows[index * PROJECTED + 7]
}
