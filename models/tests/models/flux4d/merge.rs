//! Merging of points.

use gs_models::flux4d::merge::{EDGE_MAX, EDGE_MIN, MergeConfig, Merged, TimedPoints, ladder, merge, merge_to_budget};

use super::cloud;

#[test]
fn points_of_one_voxel_and_time_become_their_mean() {
    let points = TimedPoints {
        points: vec![[5.0, 5.0, 5.0], [0.1, 0.1, 0.1], [0.3, 0.1, 0.1], [0.1, 0.1, 0.1], [-0.1, 0.1, 0.1]],
        times: vec![0.0, 0.0, 0.2, 0.9, 0.0],
        colors: vec![None, Some([0.5; 3]), None, None, None],
    };
    let merged = merge(&points, 0.5, 2).expect("points");
    // `f32` halves of sums that are not exact.
    let expected = [[5.0, 5.0, 5.0], [0.2, 0.1, 0.1], [0.1, 0.1, 0.1], [-0.1, 0.1, 0.1]];
    for (found, expected) in merged.points.concat().iter().zip(expected.concat()) {
        assert!((found - expected).abs() < 1e-6, "{:?}", merged.points);
    }
    assert_eq!(merged.times, [0.0, 0.1, 0.9, 0.0]);
    assert_eq!(merged.colors, [None, Some([0.5; 3]), None, None]);
    assert_eq!(merge(&points, 0.5, 1).expect("points").points.len(), 3);
}

#[test]
fn the_ladder_ends_at_the_budget() {
    let points = cloud(5000, 4.0, 9);
    let points = TimedPoints { times: vec![0.5; 5000], colors: vec![None; 5000], points };
    let within = |budget| {
        merge_to_budget(vec![points.clone()], &MergeConfig { budget, times: 6, viewpoints: &[] }).expect("points")
    };
    assert_eq!(within(5000), Merged { parts: vec![points.clone()], edge: None });
    let edges = ladder();
    for budget in [4900, 4000, 2000, 500, 100] {
        let merged = within(budget);
        let step = edges.iter().position(|edge| Some(*edge) == merged.edge).expect("a step of the ladder");
        let kept = merged.parts[0].points.len();
        assert!(kept <= budget);
        assert!(merge(&points, edges[step - 1], 6).expect("points").points.len() > budget, "a smaller voxel would do");
        // Points that fill a volume become an eighth when the edge doubles: a step of the ladder keeps 0.77 of them.
        // The cloud is 8 m wide and its number of cells along an axis is whole, so a step may keep less where they are
        // large.
        assert!(kept * 2 >= budget, "{kept} of {budget}");
    }
    assert_eq!(within(1).edge, Some(EDGE_MAX));
    assert!(merge(&points, f32::NAN, 6).is_err() && merge(&points, 0.1, 0).is_err());
}

#[test]
fn points_of_two_parts_stay_apart() {
    let part = TimedPoints { points: vec![[0.1; 3]; 4], times: vec![0.0; 4], colors: vec![None; 4] };
    let merged = merge_to_budget(vec![part.clone(), part], &MergeConfig { budget: 2, times: 1, viewpoints: &[] })
        .expect("points");
    assert_eq!(merged.parts.iter().map(|part| part.points.len()).collect::<Vec<_>>(), [1, 1]);
    assert_eq!(merged.edge, Some(EDGE_MIN));
}

/// A scanner at the origin meets a wall near by and one that is ten times as far, at equal angles, with equally many
/// points. At one edge the near wall keeps a hundredth of what the far one keeps, with viewpoints a tenth, up to the
/// rounding of edges: each is rounded down by up to a square root of two, so numbers on a surface by up to two.
#[test]
fn viewpoints_keep_more_of_what_is_near() {
    let wall = |x: f32| (0..100 * 100).map(move |i| [x, x * (i % 100) as f32 / 100.0, x * (i / 100) as f32 / 100.0]);
    let points: Vec<[f32; 3]> = wall(3.0).chain(wall(30.0)).collect();
    let points = TimedPoints { times: vec![0.0; points.len()], colors: vec![None; points.len()], points };
    let near_over_far = |viewpoints: &[[f32; 3]]| {
        let config = MergeConfig { budget: 4000, times: 1, viewpoints };
        let merged = merge_to_budget(vec![points.clone()], &config).expect("points");
        let kept = &merged.parts[0].points;
        assert!(kept.len() <= 4000 && kept.len() >= 2000, "{}", kept.len());
        let near = kept.iter().filter(|point| point[0] < 10.0).count() as f64;
        near / (kept.len() as f64 - near)
    };
    let (one_edge, growing) = (near_over_far(&[]), near_over_far(&[[0.0; 3]]));
    assert!((0.005..0.02).contains(&one_edge), "{one_edge}");
    assert!((0.05..0.2).contains(&growing), "{growing}");
    // The nearest viewpoint counts: the far wall has one as near now.
    let both = near_over_far(&[[0.0; 3], [27.0, 0.0, 0.0]]);
    assert!(both < 0.5 * growing, "{both}");
    let within = MergeConfig { budget: 1, times: 1, viewpoints: &[[0.0; 3]] };
    assert_eq!(merge_to_budget(vec![points.clone()], &within).expect("points").edge, Some(EDGE_MAX));
    let bad = MergeConfig { budget: 1, times: 1, viewpoints: &[[f32::NAN; 3]] };
    assert!(merge_to_budget(vec![points], &bad).is_err());
}
