//! The proximal step in pixels, and how many pixels a scene unit is.

use gs_burn::glam::{DMat4, DVec3};
use gs_burn::{Camera, Intrinsics};
use gs_models::taylormode::shrinkage::{pixels_per_unit, shrink};
use gs_tests::devices::everywhere;
use gs_tests::tolerance::{assert_near, values};

#[test]
fn blocks_lose_pixels_and_never_turn_round() {
    for place in everywhere() {
        // Blocks of 5, 0.1 and 0 units in the first row; 5, 1, 0.2 in the second, which is seen ten times as large.
        let blocks = [3.0, 0.0, 4.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 1.0, 0.0, 0.2, 0.0, 0.0];
        let scale = place.tensor(&[10.0, 100.0], [2, 1]);
        let found = values(&shrink(place.tensor(&blocks, [2, 9]), &scale, &[5.0, 5.0, 10.0]));
        // 50 px less 5, 1 px less 5, 0; 500 px less 5, 100 px less 5, 20 px less 10.
        let expected = [2.7, 0.0, 3.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.95, 0.0, 0.0, 0.95, 0.0, 0.1, 0.0, 0.0];
        assert_near(&place.name, &found, &expected, 1e-6);
        let kept = values(&shrink(place.tensor(&blocks, [2, 9]), &scale, &[0.0; 3]));
        assert_near(&place.name, &kept, &blocks, 1e-7);
        let unseen = values(&shrink(place.tensor(&blocks, [2, 9]), &place.tensor(&[0.0; 2], [2, 1]), &[1e-3; 3]));
        assert_eq!(unseen, [0.0; 18], "{}: motion that nobody sees", place.name);
    }
}

#[test]
fn the_nearest_camera_that_sees_it_counts() {
    for place in everywhere() {
        let intrinsics = Intrinsics { fx: 100.0, fy: 80.0, cx: 32.0, cy: 24.0 };
        let camera = |z: f64| {
            let pose = DMat4::from_translation(DVec3::new(0.0, 0.0, z));
            Camera::from_c2w(pose, intrinsics, 64, 48, &place.device)
        };
        // Straight ahead of both, between them, behind both, far to the side of both.
        let means = [0.0, 0.0, 4.0, 0.0, 0.0, 1.0, 0.0, 0.0, -9.0, 50.0, 0.0, 4.0];
        let found: Vec<f64> = pixels_per_unit(&means, &[camera(0.0), camera(2.0)]).into_iter().map(f64::from).collect();
        assert_near(&place.name, &found, &[50.0, 100.0, 0.0, 0.0], 1e-4);
    }
}
