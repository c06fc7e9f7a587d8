//! The height of points above the ground under them.
//!
//! The ground of a cell is the lowest of the cells around it. Far from the LiDAR its rings on the road are so wide
//! apart that a car has no road around it, and its bumper would be the ground. There a plane through the lowest points
//! of a wider area is the ground, unless a sweep shows a terrain that is higher: a ring on a lawn is wider than a
//! bumper.

use std::collections::HashMap;

use rayon::prelude::*;

use super::groups::{self, Cell, around};
use super::in_plan;

/// Edge of a cell of the ground, metres: a slope of 10 % rises by the noise of a few LiDAR points over it.
const CELL: f64 = 1.0;
/// Cells to each side in which the ground is looked for: a car hides the ground 2 m around its middle.
const AROUND: i32 = 2;
/// Share of the points of a cell that may lie below the ground: reflections in wet roads do.
const BELOW: f64 = 0.05;
/// Cells to each side through which a plane is laid: two rings of a LiDAR of 32 beams are 14 m apart at 40 m.
const PLANE_AROUND: i32 = 10;
/// Cells that share a plane, to each side.
const PATCH: i32 = 4;
/// Fewest cells of a plane, and the share of them that must lie on it.
const PLANE_CELLS: usize = 20;
const PLANE_SHARE: f64 = 0.3;
/// Distance up to which a cell lies on a plane, and a point on the terrain, metres: half a kerb.
const LEVEL: f64 = 0.1;
/// Share of the cells that lie below the plane: houses and cars stand in most cells of a narrow street.
const QUANTILE: f64 = 0.15;
/// Rounds of the fit; the planes of a street change by less than a centimetre after these.
const ROUNDS: usize = 8;
/// Cells of one sweep at one height that are a terrain: one more than the widest bumper touches.
const TERRAIN_CELLS: usize = 4;
/// Cells to each side among which these are, so that the end of a ring is a terrain as well.
const TERRAIN_AROUND: i32 = 4;
/// Height above the plane up to which such cells are a terrain, metres: a lawn above its kerb. One beam on the side of
/// a car is higher.
const TERRAIN_HEIGHT: f32 = 0.4;

type Heights = HashMap<Cell, f32>;

/// Heights of the ground.
#[derive(Debug)]
pub struct Ground(Heights);

fn cell(point: &[f32; 3]) -> Cell {
    groups::cell(&in_plan(point), CELL)
}

/// The height of each cell that few points lie below.
fn lows<'a>(points: impl Iterator<Item = &'a [f32; 3]>) -> Heights {
    let mut heights: HashMap<Cell, Vec<f32>> = HashMap::new();
    for point in points {
        heights.entry(cell(point)).or_default().push(point[2]);
    }
    let low = heights.into_iter().map(|(cell, mut heights)| {
        let place = (heights.len() as f64 * BELOW) as usize;
        let (_, low, _) = heights.select_nth_unstable_by(place, f32::total_cmp);
        (cell, *low)
    });
    low.collect()
}

impl Ground {
    /// Of the points of all sweeps.
    pub fn of(sweeps: &[&[[f32; 3]]]) -> Self {
        let low = lows(sweeps.iter().copied().flatten());
        let of_sweeps: Vec<Heights> = sweeps.par_iter().map(|points| lows(points.iter())).collect();
        let mut planes: HashMap<Cell, Option<[f64; 3]>> = HashMap::new();
        let mut ground = Heights::with_capacity(low.len());
        for at in low.keys() {
            let lowest = around(*at, AROUND).filter_map(|cell| low.get(&cell)).copied().fold(f32::INFINITY, f32::min);
            let patch = at.map(|x| x.div_euclid(PATCH));
            let plane = planes.entry(patch).or_insert_with(|| plane(&low, patch.map(|x| x * PATCH + PATCH / 2)));
            let below = plane.map_or(f32::INFINITY, |[height, along, across]| {
                let [x, y] = [0, 1].map(|axis| f64::from(at[axis] - patch[axis] * PATCH - PATCH / 2));
                (height + along * x + across * y) as f32
            });
            let is_terrain = || of_sweeps.iter().any(|low| level(low, *at, lowest) >= TERRAIN_CELLS);
            let above = lowest - below;
            let covered = above > TERRAIN_HEIGHT || above > LEVEL as f32 && !is_terrain();
            ground.insert(*at, if covered { below } else { lowest });
        }
        Self(ground)
    }

    /// Height of the ground at a place, where it is known.
    pub fn at(&self, x: f64, y: f64) -> Option<f32> {
        self.0.get(&groups::cell(&[x, y], CELL)).copied()
    }

    /// Lowest known height of the ground around a place: a LiDAR sees no ground under its own vehicle.
    pub fn near(&self, x: f64, y: f64) -> Option<f32> {
        let heights = around(groups::cell(&[x, y], CELL), PLANE_AROUND).filter_map(|cell| self.0.get(&cell).copied());
        heights.min_by(f32::total_cmp)
    }

    /// Metres above the ground; the point is one of those that it was made of.
    pub fn above(&self, point: &[f32; 3]) -> f32 {
        self.0.get(&cell(point)).map_or(0.0, |ground| point[2] - ground)
    }
}

/// Cells around one whose lowest points are at a height.
fn level(low: &Heights, at: Cell, height: f32) -> usize {
    let at_height = |low: &&f32| f64::from((**low - height).abs()) <= LEVEL;
    around(at, TERRAIN_AROUND).filter_map(|cell| low.get(&cell)).filter(at_height).count()
}

/// Height at a cell, and the rise from cell to cell, of the plane that a quantile of the cells around lies below;
/// `None` where too few lie on it.
fn plane(low: &Heights, at: Cell) -> Option<[f64; 3]> {
    let cells: Vec<([f64; 3], f64)> = around(at, PLANE_AROUND)
        .filter_map(|cell| {
            let [x, y] = [0, 1].map(|axis| f64::from(cell[axis] - at[axis]));
            Some(([1.0, x, y], f64::from(*low.get(&cell)?)))
        })
        .collect();
    if cells.len() < PLANE_CELLS {
        return None;
    }
    let mut heights: Vec<f64> = cells.iter().map(|(_, height)| *height).collect();
    let place = (QUANTILE * heights.len() as f64) as usize;
    let (_, start, _) = heights.select_nth_unstable_by(place, f64::total_cmp);
    let mut plane = [*start, 0.0, 0.0];
    let above =
        |plane: &[f64; 3], (row, height): &([f64; 3], f64)| height - (0..3).map(|i| row[i] * plane[i]).sum::<f64>();
    // Quantile regression by least squares with weights.
    for _ in 0..ROUNDS {
        let (mut matrix, mut right) = (glam::DMat3::ZERO, glam::DVec3::ZERO);
        for cell in &cells {
            let over = above(&plane, cell);
            let side = if over > 0.0 { QUANTILE } else { 1.0 - QUANTILE };
            let (row, weight) = (glam::DVec3::from_array(cell.0), side / over.abs().max(0.02));
            matrix += weight * glam::DMat3::from_cols(row * row.x, row * row.y, row * row.z);
            right += weight * cell.1 * row;
        }
        let solved = matrix.inverse() * right;
        if !solved.is_finite() {
            return None;
        }
        plane = solved.to_array();
    }
    let on = cells.iter().filter(|cell| above(&plane, cell).abs() <= LEVEL).count();
    (on as f64 >= PLANE_SHARE * cells.len() as f64).then_some(plane)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rings on a road that rises by 3 %, and what stands between two of them.
    fn heights(extra: &[[f32; 3]]) -> Vec<f32> {
        let road = |x: f32| 0.03 * x;
        let ring = |radius: f32| {
            (-60..=60).map(move |step| {
                let angle = (step as f32).to_radians();
                let (x, y) = (radius * angle.cos(), radius * angle.sin());
                [x, y, road(x)]
            })
        };
        let mut points: Vec<[f32; 3]> = [12.0, 16.0, 21.0, 27.0, 34.0, 46.0].into_iter().flat_map(ring).collect();
        let first = points.len();
        points.extend(extra.iter().map(|[x, y, z]| [*x, *y, road(*x) + z]));
        let ground = Ground::of(&[&points]);
        points[first..].iter().map(|point| ground.above(point)).collect()
    }

    /// The bumper of a car is 2 m wide, and no point of the road is near it. Heights are known to the level, 0.1 m.
    #[test]
    fn a_bumper_is_not_the_ground() {
        let bumper: Vec<[f32; 3]> = (0..9).map(|step| [40.0, -1.0 + 0.25 * step as f32, 0.4]).collect();
        for height in heights(&bumper) {
            assert!((height - 0.4).abs() <= 0.1, "{height}");
        }
    }

    /// A ring on a lawn is longer than a bumper: it is a terrain, whose points stand on themselves.
    #[test]
    fn a_lawn_is_a_ground() {
        let lawn: Vec<[f32; 3]> = (0..32).map(|step| [40.0, 6.0 + 0.25 * step as f32, 0.3]).collect();
        for height in heights(&lawn) {
            assert!(height.abs() <= 0.1, "{height}");
        }
    }

    #[test]
    fn no_points_have_no_ground() {
        assert_eq!(Ground::of(&[]).above(&[1.0, 2.0, 3.0]), 0.0);
    }
}
