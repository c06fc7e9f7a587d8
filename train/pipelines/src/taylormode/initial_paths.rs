//! The initial paths of moving Gaussians: those of the centres of their objects, triangulated from masks.

use glam::DVec3;
use gs_base::dense::solve_columns;
use gs_models::taylormode::window::polynomials;
use gs_models::taylormode::{Contact, MotionFrame, TimeWindow};
use gs_multiview::{Kink, Track, Trajectory};

/// Sample times of a path for each order that is fitted.
const SAMPLES_PER_ORDER: usize = 4;

/// The order (at least `least`) and the contacts of initial paths: the fewest that miss no path by more than `unseen`,
/// a root mean square share of the image width; `widths_per_unit` is the number of image widths per scene unit. Any
/// further number would be fitted to noise.
pub fn shape(
    tracks: &[Track],
    window: TimeWindow,
    contacts: Vec<Contact>,
    (widths_per_unit, unseen): (f64, f64),
    least: usize,
) -> (usize, Vec<Contact>) {
    let highest = tracks.iter().map(|track| track.path.order()).max().unwrap_or(0).max(least);
    let is_unseen = |order: usize, contacts: &[Contact]| {
        tracks.iter().all(|track| {
            let blocks = displacement_blocks(&track.path, window, order, contacts);
            let missed = missed_by(&track.path, window, contacts, &blocks) * widths_per_unit;
            tracing::debug!(order, kinks = contacts.len(), missed, "the centre's path at an order");
            missed <= unseen
        })
    };
    if let Some(order) = (least..=highest).find(|order| is_unseen(*order, &[])) {
        return (order, Vec::new());
    }
    ((least..highest).find(|order| is_unseen(*order, &contacts)).unwrap_or(highest), contacts)
}

/// Root mean square distance of `blocks` from the path, over the times at which it is known, scene units.
fn missed_by(path: &Trajectory, window: TimeWindow, contacts: &[Contact], blocks: &[f32]) -> f64 {
    let orders = blocks.len() / 3 - contacts.len();
    let squares: Vec<f64> = displacements(path, window, orders, contacts)
        .map(|(values, displacement)| {
            let blocks = blocks.as_chunks::<3>().0.iter().zip(values);
            let fitted: DVec3 = blocks.map(|(block, value)| value * glam::Vec3::from(*block).as_dvec3()).sum();
            fitted.distance_squared(displacement)
        })
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// Times at which a path is known, with the values of the polynomials and ramps and the displacement since `t0`.
fn displacements(
    path: &Trajectory,
    window: TimeWindow,
    order: usize,
    contacts: &[Contact],
) -> impl Iterator<Item = (Vec<f64>, DVec3)> {
    let count = SAMPLES_PER_ORDER * (order + contacts.len()).max(1) + 1;
    let start = path.position(window.t0);
    (0..count).map(move |i| {
        let t = path.t0 + path.half * (2.0 * i as f64 / (count - 1) as f64 - 1.0);
        let s = window.normalised(t);
        let polynomials = polynomials(s, order).into_iter().map(|sample| sample.value);
        (polynomials.chain(contacts.iter().map(|contact| contact.ramp(s).value)).collect(), path.position(t) - start)
    })
}

/// The kinks of all paths in the window, in descending order of their jumps, at most `most` and apart from each other:
/// objects that collide have a kink at one time. A kink at `t0` itself is left to the polynomial.
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

/// Blocks and jumps of each moving Gaussian: those of the object whose centre is nearest to it at `t0`.
pub fn initial_paths(tracks: &[Track], frame: &MotionFrame, means: &[[f32; 3]], order: usize) -> (Vec<f32>, Vec<f32>) {
    let blocks: Vec<Vec<f32>> =
        tracks.iter().map(|track| displacement_blocks(&track.path, frame.window, order, &frame.contacts)).collect();
    let (mut paths, mut jumps) = (Vec::new(), Vec::new());
    for row in &frame.rows {
        let position = glam::Vec3::from(means[*row as usize]).as_dvec3();
        let (path, jump) = blocks[nearest(tracks, frame.window.t0, position)].split_at(3 * order);
        paths.extend_from_slice(path);
        jumps.extend_from_slice(jump);
    }
    (paths, jumps)
}

/// Index of the track whose object is nearest to `position` at `t`.
///
/// # Panics
/// Without tracks.
pub fn nearest(tracks: &[Track], t: f64, position: DVec3) -> usize {
    let distances = tracks.iter().map(|track| track.path.position(t).distance_squared(position));
    let nearest = distances.enumerate().min_by(|(_, a), (_, b)| a.total_cmp(b));
    nearest.expect("there are tracks").0
}

/// Added to the diagonal, as a share of its sum: numbers that the times do not determine (the jump of an object that
/// was seen only after a contact) stay zero, and the others change in the tenth digit.
const RIDGE: f64 = 1e-10;

/// The path as coefficient blocks of the window, first of the polynomials, then of the contacts. They are the least
/// squares fit of `sum_k c_k f_k(s) + sum_j a_j r_j(s)`, without a constant, to the displacement since `t0` over the
/// times at which the path is known.
pub fn displacement_blocks(path: &Trajectory, window: TimeWindow, order: usize, contacts: &[Contact]) -> Vec<f32> {
    let columns = order + contacts.len();
    let mut normal = vec![vec![0.0; columns + 3]; columns];
    for (values, displacement) in displacements(path, window, order, contacts) {
        let displacement = displacement.to_array();
        for (row, equation) in normal.iter_mut().enumerate() {
            for (column, entry) in equation.iter_mut().enumerate() {
                *entry += values[row] * if column < columns { values[column] } else { displacement[column - columns] };
            }
        }
    }
    let ridge = RIDGE * (0..columns).map(|i| normal[i][i]).sum::<f64>().max(f64::MIN_POSITIVE);
    (0..columns).for_each(|i| normal[i][i] += ridge);
    solve_columns::<3>(normal).into_iter().flatten().map(|x| x as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_multiview::Centre;

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
        // The window's centre at the recording's middle, and beside it: then the window is longer than the recording on
        // one side.
        for window in [TimeWindow { t0: 0.5, half: 0.5 }, TimeWindow { t0: 0.4, half: 0.65 }] {
            let blocks = displacement_blocks(&path, window, 3, &[]);
            for t in [0.0, 0.3, 0.8, 1.0] {
                let s = window.normalised(t);
                let values = polynomials(s, 3);
                let moved: Vec<f64> =
                    (0..3).map(|a| (0..3).map(|k| f64::from(blocks[3 * k + a]) * values[k].value).sum()).collect();
                assert!((DVec3::from_slice(&moved) - (truth(t) - truth(window.t0))).length() < 1e-5, "{t}: {moved:?}");
            }
        }
    }

    /// An object that is first seen after the contact of another: its times do not determine its jump there.
    #[test]
    fn jumps_before_a_path_begins_are_none() {
        let path = |range: [f64; 2], position: &dyn Fn(f64) -> DVec3| {
            let times = (0..=20).map(|i| range[0] + (range[1] - range[0]) * f64::from(i) / 20.0);
            let centres: Vec<Centre> =
                times.map(|t| Centre { t, position: position(t), residual_px: 0.1, cameras: 5 }).collect();
            let path = Trajectory::fit(&centres, 3, 2).expect("a path");
            Track { centres, path }
        };
        let window = TimeWindow { t0: 0.5, half: 0.5 };
        let hit = path([0.0, 1.0], &|t| DVec3::new(t, (4.0 * (t - 0.2)).abs(), 0.0));
        let late = path([0.4, 1.0], &|t| DVec3::new(0.0, 1.0, t));
        let contacts = contacts(&[hit], &window, 2);
        assert_eq!(contacts.len(), 1);
        let blocks = displacement_blocks(&late.path, window, 2, &contacts);
        assert!(blocks.iter().all(|x| x.is_finite()), "{blocks:?}");
        assert!(blocks[6..].iter().all(|x| x.abs() < 1e-6), "{blocks:?}");
        assert!((blocks[2] - 0.5).abs() < 1e-4, "{blocks:?}");
    }

    /// The initial order and number of contacts of a path whose centre follows `truth`, at 100 pixels per unit.
    fn shape_of(truth: impl Fn(f64) -> DVec3) -> (usize, usize) {
        let centres: Vec<Centre> = (0..=20)
            .map(|i| f64::from(i) / 20.0)
            .map(|t| Centre { t, position: truth(t), residual_px: 0.1, cameras: 5 })
            .collect();
        let path = Trajectory::fit(&centres, 6, 2).expect("a path");
        let tracks = [Track { centres, path }];
        let window = TimeWindow { t0: 0.5, half: 0.5 };
        let (order, contacts) = shape(&tracks, window, contacts(&tracks, &window, 2), (100.0 / 256.0, 0.5 / 256.0), 1);
        (order, contacts.len())
    }

    #[test]
    fn paths_begin_with_what_shows() {
        let line = |t: f64| DVec3::new(2.0 * t, -t, 0.5);
        assert_eq!(shape_of(line), (1, 0));
        // A third power of 0.2 pixels at the ends, and one of 20.
        let cubic = |height: f64| move |t: f64| line(t) + height * (2.0 * t - 1.0).powi(3) * DVec3::Z;
        assert_eq!(shape_of(cubic(0.002)), (1, 0));
        assert_eq!(shape_of(cubic(0.2)).0, 3);
        // A bend of 60 degrees at time 0.7, and one that adds half a pixel at the end.
        let bent = |change: f64| move |t: f64| line(t) + change * (t - 0.7).max(0.0) * DVec3::Z;
        assert_eq!(shape_of(bent(4.0)).1, 1);
        assert_eq!(shape_of(bent(0.016)).1, 0);
    }
}
