//! The depths at which a photo's pixel may lie, from points of the scene that are known already.

use glam::{DMat4, Vec3};
use gs_base::Intrinsics;

/// Side of a cell in which depths are gathered, pixels of a reduced photo (320 wide). A pixel asks its own cell and the
/// eight around it.
const CELL: usize = 16;

/// Fewest points around a pixel that are trusted to span its depths; with fewer, the depths of the whole photo are
/// searched.
const FEWEST: usize = 6;

/// Share of the depths left out at either end: single points lie far off.
const OUTSIDE: f64 = 0.05;

/// Factor by which the depths that points span are widened at either end: a surface goes on beyond its outermost point.
const MARGIN: f64 = 1.15;

/// Depths that known points span in one photo.
pub(crate) struct DepthRange {
    columns: usize,
    /// `[near, far]` by cell, camera z in scene units.
    cells: Vec<Option<[f64; 2]>>,
    /// `[near, far]` of the whole photo; `None` if it sees too few points.
    whole: Option<[f64; 2]>,
}

impl DepthRange {
    /// The depths of `points` in a photo of `width` x `height` pixels.
    pub fn of(points: &[[f32; 3]], viewmat: &DMat4, intrinsics: &Intrinsics, width: usize, height: usize) -> Self {
        let (columns, rows) = (width.div_ceil(CELL), height.div_ceil(CELL));
        let mut depths = vec![Vec::new(); columns * rows];
        for point in points {
            let seen = viewmat.transform_point3(Vec3::from(*point).as_dvec3());
            if seen.z <= 0.0 || !seen.is_finite() {
                continue;
            }
            let at = intrinsics.project(seen);
            if at.x >= 0.0 && at.y >= 0.0 && at.x < width as f64 && at.y < height as f64 {
                depths[at.y as usize / CELL * columns + at.x as usize / CELL].push(seen.z);
            }
        }
        let around = |cell: usize| {
            let (column, row) = (cell % columns, cell / columns);
            let (left, right) = (column.saturating_sub(1), (column + 1).min(columns - 1));
            let (top, bottom) = (row.saturating_sub(1), (row + 1).min(rows - 1));
            let cells = (top..=bottom).flat_map(|y| (left..=right).map(move |x| y * columns + x));
            span(cells.flat_map(|cell| depths[cell].iter().copied()).collect())
        };
        let cells = (0..depths.len()).map(around).collect();
        Self { columns, cells, whole: span(depths.concat()) }
    }

    /// `[near, far]` of what a pixel may show.
    pub fn at(&self, [x, y]: [usize; 2]) -> Option<[f64; 2]> {
        self.cells[y / CELL * self.columns + x / CELL].or(self.whole)
    }
}

/// The range of some depths without their outermost ones, widened.
fn span(mut depths: Vec<f64>) -> Option<[f64; 2]> {
    if depths.len() < FEWEST {
        return None;
    }
    depths.sort_by(f64::total_cmp);
    let left_out = (OUTSIDE * depths.len() as f64) as usize;
    Some([depths[left_out] / MARGIN, depths[depths.len() - 1 - left_out] * MARGIN])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_has_the_depths_around_it_or_those_of_the_photo() {
        let intrinsics = Intrinsics { fx: 320.0, fy: 320.0, cx: 160.0, cy: 120.0 };
        // A near wall on the left, a far one on the right, and nothing in the middle or behind the camera.
        let wall = |x: f64, z: f64| {
            (0..40).map(move |i| [(x * z) as f32, ((i as f64 / 40.0 - 0.5) * 0.6 * z) as f32, z as f32])
        };
        let mut points: Vec<[f32; 3]> = wall(-0.45, 2.0).chain(wall(0.45, 10.0)).collect();
        points.push([0.0, 0.0, -3.0]);
        let range = DepthRange::of(&points, &DMat4::IDENTITY, &intrinsics, 320, 240);
        let near = |[a, b]: [f64; 2], [x, y]: [f64; 2]| (a - x).abs() < 1e-6 && (b - y).abs() < 1e-6;
        assert!(near(range.at([16, 120]).expect("points"), [2.0 / MARGIN, 2.0 * MARGIN]));
        assert!(near(range.at([304, 120]).expect("points"), [10.0 / MARGIN, 10.0 * MARGIN]));
        assert!(near(range.at([160, 120]).expect("of the photo"), [2.0 / MARGIN, 10.0 * MARGIN]));
        assert_eq!(DepthRange::of(&points[..3], &DMat4::IDENTITY, &intrinsics, 320, 240).at([16, 16]), None);
    }
}
