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
    let within = |budget| merge_to_budget(vec![points.clone()], &MergeConfig { budget, times: 6 }).expect("points");
    assert_eq!(within(5000), Merged { parts: vec![points.clone()], voxel: None });
    let edges = ladder();
    for budget in [4900, 4000, 2000, 500, 100] {
        let merged = within(budget);
        let step = edges.iter().position(|edge| Some(*edge) == merged.voxel).expect("a step of the ladder");
        let kept = merged.parts[0].points.len();
        assert!(kept <= budget);
        assert!(merge(&points, edges[step - 1], 6).expect("points").points.len() > budget, "a smaller voxel would do");
        // Points that fill a volume become an eighth when the edge doubles: a step of the ladder keeps 0.77 of them. The
        // cloud is 8 m wide and its number of cells along an axis is whole, so a step may keep less where they are large.
        assert!(kept * 2 >= budget, "{kept} of {budget}");
    }
    assert_eq!(within(1).voxel, Some(EDGE_MAX));
    assert!(merge(&points, f32::NAN, 6).is_err() && merge(&points, 0.1, 0).is_err());
}

#[test]
fn points_of_two_parts_stay_apart() {
    let part = TimedPoints { points: vec![[0.1; 3]; 4], times: vec![0.0; 4], colors: vec![None; 4] };
    let merged = merge_to_budget(vec![part.clone(), part], &MergeConfig { budget: 2, times: 1 }).expect("points");
    assert_eq!(merged.parts.iter().map(|part| part.points.len()).collect::<Vec<_>>(), [1, 1]);
    assert_eq!(merged.voxel, Some(EDGE_MIN));
}
