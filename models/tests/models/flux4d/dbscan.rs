//! The grid version of DBSCAN against the definition.

use std::collections::VecDeque;

use gs_models::flux4d::actors::dbscan;

use super::{cloud, distance};

/// By all distances: clusters in the order of their first core point, border points to the lowest.
fn by_definition(points: &[[f32; 3]], eps: f64, min_points: usize) -> Vec<Option<u32>> {
    let near = |i: usize| (0..points.len()).filter(move |j| distance(points[i], points[*j]) <= eps);
    let core: Vec<bool> = (0..points.len()).map(|i| near(i).count() >= min_points).collect();
    let mut labels = vec![None; points.len()];
    let mut count = 0;
    for start in 0..points.len() {
        if !core[start] || labels[start].is_some() {
            continue;
        }
        let mut queue = VecDeque::from([start]);
        while let Some(i) = queue.pop_front() {
            if labels[i].is_none() {
                labels[i] = Some(count);
                queue.extend(near(i).filter(|j| core[*j]));
            }
        }
        count += 1;
    }
    for i in (0..points.len()).filter(|i| !core[*i]) {
        labels[i] = near(i).filter(|j| core[*j]).filter_map(|j| labels[j]).min();
    }
    labels
}

#[test]
fn clusters_are_those_of_the_definition() {
    // From one cluster to noise alone, with border points between; also min 1 and coincident points.
    for (seed, size, min_points) in [(1, 2.0, 10), (2, 4.0, 10), (3, 5.0, 6), (4, 9.0, 4), (5, 3.0, 1)] {
        let mut points = cloud(500, size, seed);
        points.extend_from_within(..20);
        let expected = by_definition(&points, 0.4, min_points);
        assert_eq!(dbscan(&points, 0.4, min_points).expect("points"), expected, "seed {seed}");
    }
}

#[test]
fn clusters_do_not_depend_on_the_order_of_the_points() {
    let points = cloud(400, 4.0, 8);
    let reversed: Vec<_> = points.iter().rev().copied().collect();
    let (a, b) = (dbscan(&points, 0.4, 5).expect("points"), dbscan(&reversed, 0.4, 5).expect("points"));
    let noise = |labels: &[Option<u32>]| labels.iter().filter(|label| label.is_none()).count();
    assert_eq!((a.iter().max(), noise(&a)), (b.iter().max(), noise(&b)));
}

#[test]
fn hostile_points_are_told() {
    assert_eq!(dbscan(&[], 0.4, 10).expect("nothing"), []);
    assert_eq!(dbscan(&[[1.0; 3]], 0.4, 10).expect("a point"), [None]);
    assert_eq!(dbscan(&[[1.0; 3]], 0.4, 1).expect("a point"), [Some(0)]);
    assert!(dbscan(&[[f32::NAN; 3]], 0.4, 10).is_err() && dbscan(&[[f32::INFINITY; 3]], 0.4, 10).is_err());
    assert!(dbscan(&[[0.0; 3]], 0.0, 10).is_err() && dbscan(&[[0.0; 3]], f64::NAN, 10).is_err());
    let wide = dbscan(&[[-9e4; 3], [9e4; 3]], 0.1, 10).unwrap_err().to_string();
    assert!(wide.starts_with("the spread of the points in cells is 3117691"), "{wide}");
}
