//! The proximal step in pixels, and how many pixels a scene unit is.

use gs_burn::glam::{DMat4, DVec3};
use gs_models::taylormode::shrinkage::{ViewScale, pixels_per_unit, shrink};
use gs_tests::tolerance::assert_near;

fn numbers(path: &[f32]) -> Vec<f64> {
    path.iter().map(|x| f64::from(*x)).collect()
}

#[test]
fn blocks_lose_pixels_and_never_turn_round() {
    // Blocks of 5, 0.1 and 0 units at 10 pixels a unit: 50 px less 5, 1 px less 5, 0.
    let mut near = [3.0, 0.0, 4.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0];
    shrink(&mut near, 10.0, 5.0);
    assert_near("near", &numbers(&near), &[2.7, 0.0, 3.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
    // Blocks of 5, 1 and 0.4, seen ten times as large: 500 px, 100 px and 40 px less 10, 20 and 30.
    let blocks = [0.0, 0.0, 5.0, 0.0, 1.0, 0.0, 0.4, 0.0, 0.0];
    let mut nearer = blocks;
    shrink(&mut nearer, 100.0, 10.0);
    assert_near("nearer", &numbers(&nearer), &[0.0, 0.0, 4.9, 0.0, 0.8, 0.0, 0.1, 0.0, 0.0], 1e-6);
    for (name, scale, pixels) in [("no threshold", 100.0, 0.0), ("motion that no camera judges", f64::INFINITY, 5.0)] {
        let mut kept = blocks;
        shrink(&mut kept, scale, pixels);
        assert_eq!(kept, blocks, "{name}");
    }
}

#[test]
fn the_nearest_camera_that_has_it_in_front_counts() {
    let camera = |z: f64| ViewScale { viewmat: DMat4::from_translation(DVec3::new(0.0, 0.0, -z)), focal: 100.0 };
    // Straight ahead of both, between them, behind both, far to the side of both.
    let means = [0.0, 0.0, 4.0, 0.0, 0.0, 1.0, 0.0, 0.0, -9.0, 50.0, 0.0, 4.0];
    let cameras = [camera(0.0), camera(2.0)];
    assert_eq!(pixels_per_unit(&means, &[0, 1, 2, 3], &cameras), [50.0, 100.0, f64::INFINITY, 50.0]);
    assert_eq!(pixels_per_unit(&means, &[2, 1], &cameras), [f64::INFINITY, 100.0], "rows in their own order");
    assert_eq!(pixels_per_unit(&means, &[0], &[]), [f64::INFINITY]);
}
