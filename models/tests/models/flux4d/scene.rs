//! The reconstructed scene.

use gs_base::Intrinsics;
use gs_burn::glam::DMat4;
use gs_burn::{Camera, ExposureOptions, Gaussians, RenderOptions, render, render_exposure};
use gs_models::DynamicScene;
use gs_models::flux4d::{FluxScene, PolynomialMotion};
use gs_tests::devices::{Place, everywhere, reference};
use gs_tests::tolerance::{FORWARD_F32, assert_near, values};

use crate::gaussians;
use gs_tests::scenes::Random;

/// Six Gaussians in a window of 2 s; rows 1 and 4 move at 3 and 0.5 m/s, row 2 creeps at 0.1.
fn scene(place: &Place, rest_speed: f64) -> (Gaussians, FluxScene) {
    let gaussians = gaussians(place, &mut Random::new(1));
    let mut velocity = [0.0; 36];
    (velocity[6], velocity[9]) = (6.0, 0.0);
    velocity[12] = 0.2;
    // Row 4 rests at the beginning and speeds up to 1 m per window.
    velocity[4 * 6 + 5] = 1.0;
    let times = [0.0, 0.5, 0.5, 0.5, 0.25, 1.0];
    let motion = PolynomialMotion::new(1).expect("a degree");
    let scene =
        FluxScene::new(gaussians.clone(), place.tensor(&velocity, [6, 6]), &times, motion, [10.0, 12.0], rest_speed);
    (gaussians, scene.expect("a scene"))
}

#[test]
fn rows_without_motion_carry_no_velocity() {
    for place in everywhere() {
        let (_, slow) = scene(place, 0.05);
        assert_eq!((slow.rows.clone(), slow.moving()), (vec![0, 3, 5, 1, 2, 4], 3));
        let (before, scene) = scene(place, 0.2);
        assert_eq!(
            (scene.rows.clone(), scene.moving(), scene.times.clone()),
            (vec![0, 2, 3, 5, 1, 4], 2, vec![0.5, 0.25])
        );
        assert_eq!(scene.span(), Some([10.0, 12.0]));
        let old = values(&before.means.val());
        let row = |i: usize| &old[3 * i..3 * i + 3];
        // One second is half a window. Row 1 is at home at 11 s; row 4 at 10.5 s, then moves by (u^2 - 1/16) / 2.
        let at = values(&scene.at(12.0).means.val());
        for (place_now, place_before) in [0, 2, 3, 5].iter().enumerate() {
            assert_eq!(&at[3 * place_now..3 * place_now + 3], row(*place_before));
        }
        let moved = [row(1)[0] + 3.0, row(1)[1], row(1)[2], row(4)[0], row(4)[1], row(4)[2] + 0.5 * (1.0 - 0.0625)];
        assert_near(&place.name, &at[12..], &moved, 1e-6);
        let speed = values(&scene.velocity(11.0));
        assert_eq!(speed[..12], [0.0; 12]);
        assert_near("m/s", &speed[12..], &[3.0, 0.0, 0.0, 0.0, 0.0, 0.25], 1e-6);
        let own = values(&scene.at(11.0).quats.val());
        assert_eq!(own[16..20], values(&before.quats.val())[4..8]);
        // The moving rows 1 and 0 are the rows 5 and 4 of the scene.
        let some = scene.moving_at(12.0, &[1, 0]);
        assert_eq!(values(&some.means.val()), [&at[15..18], &at[12..15]].concat());
        assert_eq!(values(&some.quats.val())[4..8], own[16..20]);
    }
}

#[test]
fn velocity_is_the_derivative_of_the_means() {
    let (_, scene) = scene(reference(), 0.2);
    let h = 1e-4;
    let slope = (scene.at(11.3 + h).means.val() - scene.at(11.3 - h).means.val()) / (2.0 * h);
    // Own times are `f32`; they cancel. The path is a quadratic, so the difference is exact but for rounding over h.
    assert_near("velocity", &values(&scene.velocity(11.3)), &values(&slope), 1e-10);
}

/// Three instants drawn with the resting rows once are the mean of three renderings.
#[test]
fn resting_rows_are_drawn_once_for_all_times() {
    for place in everywhere() {
        let (_, mut scene) = scene(place, 0.2);
        let forward = place.tensor(&[0.0, 0.0, 5.0], [1, 3]);
        scene.gaussians.means = scene.gaussians.means.map(|means| means + forward.clone());
        let intrinsics = Intrinsics { fx: 40.0, fy: 40.0, cx: 24.0, cy: 16.0 };
        let camera = Camera::from_c2w(DMat4::IDENTITY, intrinsics, 48, 32, &place.device);
        let times = [10.0, 11.0, 12.0];
        let (rows, samples) = scene.samples(&times);
        let together = render_exposure(&scene.gaussians, &rows, &samples, &camera, &ExposureOptions::default(), None);
        let one = |t: &f64| render(&scene.at(*t), &camera, &RenderOptions::default()).color;
        let mean = times.iter().map(one).reduce(|a, b| a + b).expect("three") / 3.0;
        assert!(values(&mean).iter().any(|x| *x > 0.1), "{}: nothing is in view", place.name);
        assert_near(&place.name, &values(&together.color), &values(&mean), FORWARD_F32);
    }
}

#[test]
fn a_scene_at_rest_has_no_span() {
    let (gaussians, scene) = scene(reference(), 1e3);
    assert_eq!((scene.moving(), scene.span()), (0, None));
    assert_eq!(values(&scene.at(-4.0).means.val()), values(&gaussians.means.val()));
    assert_eq!(values(&scene.velocity(0.0)), [0.0; 18]);
}

#[test]
fn unusable_input_is_told() {
    let place = reference();
    let motion = PolynomialMotion::new(0).expect("a degree");
    let make = |times: &[f32], value: f64, window: [f64; 2]| {
        let scene = FluxScene::new(
            gaussians(place, &mut Random::new(1)),
            place.tensor(&[value; 18], [6, 3]),
            times,
            motion,
            window,
            0.2,
        );
        scene.map(|_| ()).map_err(|error| error.to_string())
    };
    assert_eq!(make(&[0.0; 6], 1.0, [0.0, 1.0]), Ok(()));
    assert_eq!(
        make(&[0.0; 5], 1.0, [0.0, 1.0]).unwrap_err(),
        "there must be one of times for each of 6 points, 5 were given"
    );
    assert!(make(&[0.0; 6], f64::NAN, [0.0, 1.0]).unwrap_err().starts_with("a velocity in metres per window is NaN"));
    assert!(make(&[0.0; 6], 1.0, [1.0, 1.0]).is_err() && make(&[0.0; 6], 1.0, [0.0, f64::NAN]).is_err());
}
