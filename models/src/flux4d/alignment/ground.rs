//! The height of points above the ground under them.

use std::collections::HashMap;

/// Edge of a cell of the ground, metres: a slope of 10 % rises by the noise of a few LiDAR points over it.
const CELL: f64 = 1.0;
/// Cells to each side in which the ground is looked for: a car hides the ground 2 m around its middle.
const AROUND: i32 = 2;
/// Share of the points of a cell that may lie below the ground: reflections in wet roads do.
const BELOW: f64 = 0.05;

/// Heights of the ground.
#[derive(Debug)]
pub struct Ground(HashMap<[i32; 2], f32>);

fn cell(point: &[f32; 3]) -> [i32; 2] {
    [0, 1].map(|axis| (f64::from(point[axis]) / CELL).floor() as i32)
}

impl Ground {
    /// Of all points of all sweeps.
    pub fn of<'a>(points: impl Iterator<Item = &'a [f32; 3]>) -> Self {
        let mut heights: HashMap<[i32; 2], Vec<f32>> = HashMap::new();
        for point in points {
            heights.entry(cell(point)).or_default().push(point[2]);
        }
        let low = heights.into_iter().map(|(cell, mut heights)| {
            let place = (heights.len() as f64 * BELOW) as usize;
            let (_, low, _) = heights.select_nth_unstable_by(place, f32::total_cmp);
            (cell, *low)
        });
        let low: HashMap<_, _> = low.collect();
        let lowest = |[x, y]: [i32; 2]| {
            let around = (-AROUND..=AROUND).flat_map(|dx| (-AROUND..=AROUND).map(move |dy| [x + dx, y + dy]));
            around.filter_map(|cell| low.get(&cell).copied()).fold(f32::INFINITY, f32::min)
        };
        Self(low.keys().map(|cell| (*cell, lowest(*cell))).collect())
    }

    /// Metres above the ground; the point is one of those that it was made of.
    pub fn above(&self, point: &[f32; 3]) -> f32 {
        self.0.get(&cell(point)).map_or(0.0, |ground| point[2] - ground)
    }
}
