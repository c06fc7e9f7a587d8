//! Paths of cameras: rigid motions against closed forms, gradients by differences, paths at their instants.

use gs_base::Intrinsics;
use gs_burn::Camera;
use gs_burn::glam::{DMat4, DVec3};
use gs_models::camera_path::{Part, Path, TWIST, instants, moved, parts, twists};
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
        assert_near("the image's middle", &path.at(u, [0.0; 2]), &expected, 1e-15);
    }
    // The length of the parabola y = 1.5 (x / 2)^2 from -2 to 2, whose slope at its ends is 1.5, in 16 straight parts.
    let exact = 2.0 * ((1.0 + 1.5_f64 * 1.5).sqrt() + 1.5_f64.asinh() / 1.5);
    assert_near("length", &[path.length()], &[exact], 0.01);
}

/// Places of the image move as points at the subject's distance do; twists of 1e-4 leave their squares.
#[test]
fn places_beside_the_middle_move_with_the_camera() {
    const SMALL: f64 = 1e-4;
    let place = reference();
    let twist = Random::new(3).values(TWIST, -SMALL, SMALL);
    let given = camera(place);
    let found = matrix(&moved(&given, place.tensor(&twist, [1, TWIST]), DISTANCE).remove(0)) * matrix(&given).inverse();
    let path = Path::of(&twist.iter().map(|value| *value as f32).collect::<Vec<f32>>());
    for [x, y] in [[0.0, 0.0], [0.4, -0.3], [-0.5, 0.6]] {
        let seen = found.transform_point3(DVec3::new(x, y, 1.0) * DISTANCE);
        let expected = [seen.x / seen.z - x, seen.y / seen.z - y];
        assert_near("a place", &path.at(0.0, [x, y]), &expected, 1e-6);
    }
}

/// Rows of a frame.
const ROWS: usize = 24;

/// The shares of a row in all parts of a frame, and their derivatives.
fn of_row(parts: &[Option<Part>], row: usize) -> Vec<(f64, f64)> {
    let within = |part: &Part| {
        let own = row.checked_sub(part.first).filter(|own| *own < part.shares.len());
        own.map_or((0.0, 0.0), |own| (part.shares[own], part.slopes[own]))
    };
    parts.iter().map(|part| part.as_ref().map_or((0.0, 0.0), within)).collect()
}

/// Each row is exposed once in all, at the mean time of its height, and a shutter of all rows gives equal shares.
#[test]
fn rows_are_exposed_one_after_another() {
    assert!(parts(4, ROWS, 1.0).iter().flatten().all(|part| part.first == 0 && part.shares == [0.25; ROWS]));
    let share = 0.3;
    let found = parts(400, ROWS, share);
    for row in 0..ROWS {
        let shares = of_row(&found, row);
        let sum: f64 = shares.iter().map(|(share, _)| share).sum();
        let mean: f64 = shares.iter().zip(instants(400)).map(|((share, _), at)| share * at).sum();
        let y = (2 * row + 1) as f64 / ROWS as f64 - 1.0;
        // A part is 0.005 long, and its middle stands for all of it.
        assert!((sum - 1.0).abs() < 1e-12 && (mean - (1.0 - share) * y).abs() < 5e-3, "row {row}: {sum}, {mean}");
    }
}

#[test]
fn shares_of_rows_have_right_derivatives() {
    const STEP: f64 = 1e-6;
    for share in [0.11, 0.47, 0.93] {
        let [less, own, more] = [-STEP, 0.0, STEP].map(|step| parts(7, ROWS, share + step));
        for row in 0..ROWS {
            for ((less, own), more) in of_row(&less, row).iter().zip(of_row(&own, row)).zip(of_row(&more, row)) {
                let slope = (more.0 - less.0) / (2.0 * STEP);
                assert!((slope - own.1).abs() < 1e-6, "row {row} at {share}: {} for {slope}", own.1);
            }
        }
    }
}

/// A share more of the frame makes no row brighter, at the end of the range too, where the first and last part begin
/// and end with the frame.
#[test]
fn slopes_of_a_row_cancel() {
    for share in [0.02, 0.3, 0.5, 1.0] {
        let found = parts(6, ROWS, share);
        for row in 0..ROWS {
            let sum: f64 = of_row(&found, row).iter().map(|(_, slope)| slope).sum();
            assert!(sum.abs() < 1e-9, "row {row} at {share}: {sum}");
        }
    }
}
