//! Points where photos agree lie on surfaces, and there are none where nothing can agree.

use gs_datasets::{PointCloud, Scene};
use gs_multiview::{plane_sweep, plane_sweep_around};

use crate::fixture::still_world;

/// Of the points before the held-out camera, which the sweep does not see: how many there are, how many lie on or
/// behind what is seen, and their depths over the true ones, sorted.
fn against_truth(scene: &Scene, points: &PointCloud) -> (i32, i32, Vec<f64>) {
    let view = &scene.held_out[0].views[0];
    let depth = view.truth.depth.as_ref().expect("the true depth");
    let (mut seen, mut near, mut floating) = (0, 0, Vec::new());
    for position in &points.positions {
        let position = view.c2w.inverse().transform_point3(glam::Vec3::from(*position).as_dvec3());
        let k = &view.intrinsics;
        let (x, y) = (k.fx * position.x / position.z + k.cx, k.fy * position.y / position.z + k.cy);
        if position.z <= 0.0 || x < 1.0 || y < 1.0 || x >= view.width as f64 - 1.0 || y >= view.height as f64 - 1.0 {
            continue;
        }
        seen += 1;
        // A step of depth is 2.7 %; an edge may be a pixel away; what stands in front hides a point from this camera.
        let around = (-1..=1).flat_map(|v| (-1..=1).map(move |u| (u, v)));
        let mut ratios = around.map(|(u, v): (i32, i32)| {
            let pixel = (y as i32 + v) as usize * view.width + (x as i32 + u) as usize;
            position.z / f64::from(depth[pixel])
        });
        near += i32::from(ratios.any(|ratio| ratio > 0.95));
        floating.push(position.z / f64::from(depth[y as usize * view.width + x as usize]));
    }
    floating.sort_by(f64::total_cmp);
    (seen, near, floating)
}

#[test]
fn points_lie_on_surfaces() {
    let scene = still_world(9, 0);
    let points = plane_sweep(&scene.train, 1.0, 12.0, 800, 3);
    assert!(points.len() > 400, "{} points", points.len());
    assert_eq!(points, plane_sweep(&scene.train, 1.0, 12.0, 800, 3), "the same seed gives the same points");
    let (seen, near, floating) = against_truth(&scene, &points);
    assert!(
        seen > 300 && f64::from(near) > 0.9 * f64::from(seen),
        "{near} of {seen} points lie on or behind what is seen"
    );
    let median = floating[floating.len() / 2];
    assert!((median - 1.0).abs() < 0.02, "half the points are within 2 % of the surface, the median is {median}");
}

/// Points near known ones lie on surfaces as well, and closer to them: the parabola finds depths between two steps.
#[test]
fn known_points_lead_to_more() {
    let scene = still_world(9, 0);
    let known = plane_sweep(&scene.train, 1.0, 12.0, 300, 3);
    let around = |seed| plane_sweep_around(&scene.train, &known.positions, 4.0, 800, seed);
    let points = around(4);
    assert!(points.len() > 400, "{} points", points.len());
    assert_eq!(points, around(4), "the same seed gives the same points");
    let (seen, near, floating) = against_truth(&scene, &points);
    assert!(
        seen > 300 && f64::from(near) > 0.9 * f64::from(seen),
        "{near} of {seen} points lie on or behind what is seen"
    );
    let off = |ratios: &[f64]| {
        let mut off: Vec<f64> = ratios.iter().map(|ratio| (ratio - 1.0).abs()).collect();
        off.sort_by(f64::total_cmp);
        off[off.len() / 2]
    };
    let (before, after) = (off(&against_truth(&scene, &known).2), off(&floating));
    assert!(after < before, "the median distance from the surface is {after}, {before} without the parabola");
}

#[test]
fn nothing_known_gives_nothing() {
    let scene = still_world(9, 0);
    assert_eq!(plane_sweep_around(&scene.train, &[], 4.0, 100, 0).len(), 0);
    assert_eq!(plane_sweep_around(&scene.train, &[[0.0; 3]; 3], 4.0, 100, 0).len(), 0, "too few to span depths");
    assert_eq!(plane_sweep_around(&scene.train, &[[f32::NAN; 3]; 100], 4.0, 100, 0).len(), 0, "not finite");
    for distance in [0.0, f64::NAN, f64::INFINITY] {
        assert_eq!(plane_sweep_around(&scene.train, &[[0.0; 3]; 100], distance, 100, 0).len(), 0, "{distance}");
    }
    assert_eq!(plane_sweep_around(&scene.train[..2], &[[0.0; 3]; 100], 4.0, 100, 0).len(), 0, "two photos");
}

#[test]
fn nothing_to_agree_on_gives_nothing() {
    let mut scene = still_world(9, 0);
    assert_eq!(plane_sweep(&scene.train[..2], 1.0, 12.0, 100, 0).len(), 0, "two photos");
    for [near, far] in [[0.0, 1.0], [2.0, 1.0], [1.0, f64::INFINITY], [f64::NAN, 1.0]] {
        assert_eq!(plane_sweep(&scene.train, near, far, 100, 0).len(), 0, "depths from {near} to {far}");
    }
    assert_eq!(plane_sweep(&scene.train, 1.0, 12.0, 0, 0).len(), 0);
    for view in &mut scene.train {
        view.image.data.fill(90);
    }
    assert_eq!(plane_sweep(&scene.train, 1.0, 12.0, 100, 0).len(), 0, "one colour");
}
