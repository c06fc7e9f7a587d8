//! The paths that moving Gaussians begin with: those of the centres of the bodies they are part of, as triangulated from masks.

use gs_datasets::motion::{Kink, Trajectory};
use gs_models::taylormode::{Contact, TimeWindow};

use crate::taylormode::hints::Track;
use crate::taylormode::state::MotionState;

/// Times at which a path is sampled for each order it is fitted with.
const SAMPLES_PER_ORDER: usize = 4;

/// The kinks of all paths in the window, those of the largest jumps first, at most `most` and apart from each other: bodies that
/// hit each other are hit at one time. One at `t0` itself is left to the polynomial.
pub fn contacts(tracks: &[Track], window: &TimeWindow, most: usize) -> Vec<Contact> {
    let mut kinks: Vec<&Kink> = tracks.iter().flat_map(|track| &track.path.kinks).collect();
    kinks.sort_by(|a, b| b.jump.length_squared().total_cmp(&a.jump.length_squared()));
    let mut kept: Vec<Contact> = Vec::new();
    for contact in kinks.into_iter().filter_map(|kink| Contact::new(kink.begin, kink.end, window)) {
        if kept.len() < most && kept.iter().all(|other| !other.overlaps(&contact)) {
            kept.push(contact);
        }
    }
    kept
}

/// Blocks and jumps of each moving Gaussian: those of the body whose centre is nearest to it at `t0`.
pub fn first_paths(tracks: &[Track], state: &MotionState, means: &[[f32; 3]], order: usize) -> (Vec<f32>, Vec<f32>) {
    let blocks: Vec<Vec<f32>> =
        tracks.iter().map(|track| displacement_blocks(&track.path, state.window, order, &state.contacts)).collect();
    let centres: Vec<glam::DVec3> = tracks.iter().map(|track| track.path.position(state.window.t0)).collect();
    let (mut paths, mut jumps) = (Vec::new(), Vec::new());
    for row in &state.rows {
        let place = glam::Vec3::from(means[*row as usize]).as_dvec3();
        let distance = |track: &usize| centres[*track].distance_squared(place);
        let nearest = (0..tracks.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).expect("there are tracks");
        let (path, jump) = blocks[nearest].split_at(3 * order);
        paths.extend_from_slice(path);
        jumps.extend_from_slice(jump);
    }
    (paths, jumps)
}

/// The path as coefficient blocks of the window, those of the powers and then those of the contacts: the least squares fit of
/// `sum_k c_k s^k + sum_j a_j r_j(s)`, without a constant, to the displacement since `t0` over the times the path is known at.
pub fn displacement_blocks(path: &Trajectory, window: TimeWindow, order: usize, contacts: &[Contact]) -> Vec<f32> {
    let columns = order + contacts.len();
    let count = SAMPLES_PER_ORDER * columns + 1;
    let start = path.position(window.t0);
    let mut normal = vec![vec![0.0; columns + 3]; columns];
    for i in 0..count {
        let t = path.t0 + path.half * (2.0 * i as f64 / (count - 1) as f64 - 1.0);
        let s = window.normalised(t);
        let displacement = (path.position(t) - start).to_array();
        let powers = (1..=order as i32).map(|k| s.powi(k));
        let values: Vec<f64> = powers.chain(contacts.iter().map(|contact| contact.ramp(s).value)).collect();
        for (row, equation) in normal.iter_mut().enumerate() {
            for (column, entry) in equation.iter_mut().enumerate() {
                *entry += values[row] * if column < columns { values[column] } else { displacement[column - columns] };
            }
        }
    }
    solve(&mut normal).into_iter().flatten().map(|x| x as f32).collect()
}

/// Gauss and Jordan with pivots on `[A | B]`, `A` square and positive definite, `B` of three columns.
fn solve(rows: &mut [Vec<f64>]) -> Vec<[f64; 3]> {
    let order = rows.len();
    for column in 0..order {
        let pivot = (column..order).max_by(|a, b| rows[*a][column].abs().total_cmp(&rows[*b][column].abs()));
        rows.swap(column, pivot.unwrap_or(column));
        let lead = rows[column].clone();
        for (index, row) in rows.iter_mut().enumerate() {
            let factor = if index == column { 1.0 - 1.0 / lead[column] } else { row[column] / lead[column] };
            row.iter_mut().zip(&lead).for_each(|(entry, lead)| *entry -= factor * lead);
        }
    }
    rows.iter().map(|row| [row[order], row[order + 1], row[order + 2]]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use gs_datasets::motion::Centre;

    #[test]
    fn blocks_are_the_path() {
        let truth = |t: f64| DVec3::new(1.0 + 2.0 * t, -t * t, 0.5 * t * t * t);
        let centres: Vec<Centre> = (0..=20)
            .map(|i| Centre {
                t: f64::from(i) / 20.0,
                position: truth(f64::from(i) / 20.0),
                residual_px: 0.1,
                cameras: 5,
            })
            .collect();
        let path = Trajectory::fit(&centres, 3, 0).expect("a path");
        // In the middle of the recording and off it, where the window is longer than the recording on one side.
        for window in [TimeWindow { t0: 0.5, half: 0.5 }, TimeWindow { t0: 0.4, half: 0.65 }] {
            let blocks = displacement_blocks(&path, window, 3, &[]);
            for t in [0.0, 0.3, 0.8, 1.0] {
                let s = window.normalised(t);
                let moved: Vec<f64> =
                    (0..3).map(|a| (0..3).map(|k| f64::from(blocks[3 * k + a]) * s.powi(k as i32 + 1)).sum()).collect();
                assert!((DVec3::from_slice(&moved) - (truth(t) - truth(window.t0))).length() < 1e-5, "{t}: {moved:?}");
            }
        }
    }
}
