//! Neighbours against all distances.

use gs_models::flux4d::nearest::NearestPoints;

use super::{cloud, distance};

fn by_all_distances(points: &[[f32; 3]], row: usize) -> Vec<f64> {
    let others = (0..points.len()).filter(|other| *other != row);
    let mut distances: Vec<f64> = others.map(|other| distance(points[row], points[other])).collect();
    distances.sort_by(f64::total_cmp);
    distances.truncate(3);
    distances
}

/// `f32` squares of distances of order 10 are off by 1e-6 of themselves.
fn assert_found(points: &[[f32; 3]]) {
    let found = NearestPoints::new(points).all::<3>();
    for (row, neighbours) in found.iter().enumerate() {
        let expected = by_all_distances(points, row);
        for (i, (squared, other)) in neighbours.iter().enumerate() {
            match expected.get(i) {
                None => assert!(squared.is_infinite(), "point {row} of {} has no neighbour {i}", points.len()),
                Some(expected) => {
                    let found = f64::from(*squared).sqrt();
                    assert!((found - expected).abs() <= 1e-5 * (1.0 + expected), "{row}, {i}: {found} not {expected}");
                    assert_ne!(*other as usize, row, "a point is not its own neighbour");
                    assert!((distance(points[row], points[*other as usize]) - found).abs() < 1e-5 * (1.0 + found));
                }
            }
        }
    }
}

#[test]
fn neighbours_are_the_nearest() {
    assert_found(&cloud(700, 20.0, 1));
    // Dense near the origin as a sweep is, and flat.
    let sweep = cloud(600, 2.0, 2).iter().map(|p| [p[0].powi(5) * 90.0, p[1].powi(5) * 90.0, 0.0]).collect::<Vec<_>>();
    assert_found(&sweep);
}

#[test]
fn coincident_and_few_points_are_found() {
    assert_found(&[[1.0, 2.0, 3.0]; 100]);
    for count in 0..20 {
        assert_found(&cloud(count, 1.0, 3));
    }
    let line: Vec<[f32; 3]> = (0..200).map(|i| [(i / 10) as f32, 0.0, 0.0]).collect();
    assert_found(&line);
}

#[test]
fn the_tree_does_not_depend_on_threads() {
    let points = cloud(40_000, 30.0, 4);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| NearestPoints::new(&points).all::<3>())
    };
    assert_eq!(on(1), on(3));
}
