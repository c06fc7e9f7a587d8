//! Paths of cameras: rigid motions against closed forms, gradients by differences, paths at their instants.

use gs_base::Intrinsics;
use gs_burn::Camera;
use gs_burn::glam::{DMat4, DVec3};
use gs_models::camera_path::{Path, TWIST, instants, moved, twists};
use gs_tests::devices::{Place, doubles, everywhere, reference};
use gs_tests::finite_differences::assert_derivatives;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_near, values};

const DISTANCE: f64 = 2.5;

fn camera(place: &Place) -> Camera {
    let turn = DMat4::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), 0.7);
    let intrinsics = Intrinsics { fx: 100.0, fy: 100.0, cx: 8.0, cy: 6.0 };
    Camera::from_c2w(turn * DMat4::from_translation(DVec3::new(0.3, -1.0, 2.0)), intrinsics, 16, 12, &place.device)
}

fn matrix(camera: &Camera) -> DMat4 {
    let rows: [f64; 16] = values(&camera.viewmat).try_into().expect("16 numbers");
    DMat4::from_cols_array(&rows).transpose()
}

/// The exponential of a twist in closed form: Rodrigues' turn, and the shift `V t` with `V = I + (1 - cos a) / a^2 W +
/// (a - sin a) / a^3 W^2`.
fn closed(twist: &[f64]) -> DMat4 {
    let (turn, shift) = (DVec3::from_slice(twist), DVec3::from_slice(&twist[3..]) * DISTANCE);
    let (a, across) = (turn.length(), turn.cross(shift));
    let shift = shift + across * ((1.0 - a.cos()) / (a * a)) + turn.cross(across) * ((a - a.sin()) / (a * a * a));
    DMat4::from_translation(shift) * DMat4::from_axis_angle(turn / a, a)
}

/// Twists of at most 0.5 leave 5e-9 of the series; `viewmat` itself has 24 bits.
#[test]
fn motions_are_those_of_the_closed_form() {
    for place in doubles() {
        let all = Random::new(1).values(10 * TWIST, -0.25, 0.25);
        let given = camera(place);
        let found = moved(&given, place.tensor(&all, [10, TWIST]), DISTANCE);
        for (twist, found) in all.chunks(TWIST).zip(found) {
            let expected = (closed(twist) * matrix(&given)).to_cols_array();
            assert_near(&place.name, &matrix(&found).to_cols_array(), &expected, 2e-8);
        }
    }
}

#[test]
fn no_twist_moves_nothing() {
    for place in everywhere() {
        let given = camera(place);
        let still = moved(&given, place.tensor(&[0.0; TWIST], [1, TWIST]), DISTANCE).remove(0);
        assert_eq!(matrix(&still), matrix(&given), "{}", place.name);
    }
}

#[test]
fn the_gradient_is_right() {
    let place = reference();
    let mut random = Random::new(2);
    let (path, pull) = (random.values(3 * TWIST, -0.2, 0.2), place.tensor(&random.values(16, -1.0, 1.0), [4, 4]));
    assert_derivatives("path", place, [("twists", &path)], 3 * TWIST, |[path]| {
        let cameras = moved(&camera(place), twists(path.reshape([1, 3 * TWIST]), &instants(3)), DISTANCE);
        let sums = cameras.into_iter().zip(1..).map(|(camera, k)| (camera.viewmat * pull.clone()).sum() * k as f64);
        sums.reduce(|sum, value| sum + value).expect("three instants")
    });
}

#[test]
fn paths_pass_through_their_places() {
    let place = reference();
    // A turn about y, to the right; then a bend by a shift down.
    let path = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let at = instants(4);
    assert_eq!(at, [-0.75, -0.25, 0.25, 0.75]);
    let found = values(&twists(place.tensor(&path, [1, 18]), &at));
    let path = Path::of(&path.map(|value| value as f32));
    for (twist, u) in found.chunks(TWIST).zip(at) {
        let expected = [2.0 * u, 1.5 * u * u - 0.5];
        assert_near("twists", &[twist[1], twist[4]], &expected, 1e-15);
        assert_near("the image's middle", &path.at(u), &expected, 1e-15);
    }
    // The length of the parabola y = 1.5 (x / 2)^2 from -2 to 2, whose slope at its ends is 1.5, in 16 straight parts.
    let exact = 2.0 * ((1.0 + 1.5_f64 * 1.5).sqrt() + 1.5_f64.asinh() / 1.5);
    assert_near("length", &[path.length()], &[exact], 0.01);
}
