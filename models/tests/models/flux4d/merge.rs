//! Merging of points.

use gs_models::flux4d::merge::{LADDER, MergeConfig, TimedPoints, merge, merge_to_budget};

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
    let within = |budget: usize| merge_to_budget(&points, &MergeConfig { budget, times: 6 }).expect("points");
    assert_eq!(within(5000), gs_models::flux4d::merge::Merged { points: points.clone(), voxel: None });
    let merged = within(2000);
    let step = LADDER.iter().position(|edge| Some(*edge) == merged.voxel).expect("a step of the ladder");
    assert!(merged.points.points.len() <= 2000);
    assert!(merge(&points, LADDER[step - 1], 6).expect("points").points.len() > 2000, "a smaller voxel would do");
    assert_eq!(within(1).voxel, Some(LADDER[5]));
    assert!(merge(&points, f32::NAN, 6).is_err() && merge(&points, 0.1, 0).is_err());
}
