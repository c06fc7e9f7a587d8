//! The lift and its activation: what goes in comes out.

use gs_models::flux4d::far::{Bounds, BoxLength, FarConfig, far_points};
use gs_models::flux4d::{FluxError, LiftConfig, LiftInput, Rotations, activate_within, lift, lift_rows};
use gs_tests::devices::singles;
use gs_tests::tolerance::{assert_near, values};

use super::{cloud, distance};

fn without_far() -> LiftConfig {
    LiftConfig { far: FarConfig { sky_points: 0, ..FarConfig::default() }, ..LiftConfig::default() }
}

fn input<'a>(points: &'a [[f32; 3]], times: &'a [f32], colors: &'a [Option<[f32; 3]>]) -> LiftInput<'a> {
    LiftInput { points, times, colors, far_color: None }
}

/// `f32`: scales of order 1 are off by a few 1e-7, divided by the slope of softplus for scales of 1 cm (1e-2).
#[test]
fn activation_gives_back_what_was_lifted() {
    let points = cloud(60, 3.0, 5);
    let colors: Vec<_> = (0..60).map(|i| Some([i as f32 / 60.0, 0.5, 1.0 - i as f32 / 60.0])).collect();
    let times: Vec<f32> = (0..60).map(|i| i as f32 / 59.0).collect();
    for place in singles() {
        let lifted = lift(&input(&points, &times, &colors), &without_far(), &place.device).expect("points");
        assert_eq!(values(&lifted.times), times.iter().map(|t| f64::from(*t)).collect::<Vec<_>>());
        let gaussians = activate_within(lifted.raw, &lifted.limits);
        assert_near(
            "means",
            &values(&gaussians.means.val()),
            &points.concat().iter().map(|x| f64::from(*x)).collect::<Vec<_>>(),
            0.0,
        );
        let expected: Vec<f64> = (0..60)
            .flat_map(|row| {
                let mut others: Vec<f64> =
                    (0..60).filter(|i| *i != row).map(|i| distance(points[row], points[i])).collect();
                others.sort_by(f64::total_cmp);
                [(others[..3].iter().sum::<f64>() / 3.0).min(0.99); 3]
            })
            .collect();
        assert_near("scales", &values(&gaussians.scales()), &expected, 1e-5);
        assert_near("opacities", &values(&gaussians.opacities()), &[0.5; 60], 1e-6);
        let norms = values(&gaussians.quats.val().square().sum_dim(1));
        assert_near("norms", &norms, &[1.0; 60], 1e-5);
        // Half a step of 8 bits at the ends of the range.
        let seen: Vec<f64> = values(&gaussians.sh.val()).iter().map(|sh| 0.5 + 0.282_094_791_773_878_14 * sh).collect();
        let asked: Vec<f64> = colors.iter().flatten().flatten().map(|c| f64::from(*c)).collect();
        assert_near("colours", &seen, &asked, 0.5 / 255.0 + 1e-5);
    }
}

#[test]
fn a_point_without_colour_takes_that_of_its_neighbours() {
    let points = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [90.0, 0.0, 0.0],
        [91.0, 0.0, 0.0],
        [92.0, 0.0, 0.0],
        [93.0, 0.0, 0.0],
    ];
    let mut colors = [None; 8];
    (colors[1], colors[2]) = (Some([0.2, 0.4, 0.6]), Some([0.4, 0.6, 0.8]));
    let rows = lift_rows(&input(&points, &[0.0; 8], &colors), &without_far()).expect("points");
    let color = |row: usize| {
        rows.raw[14 * row + 11..14 * (row + 1)].iter().map(|x| 1.0 / (1.0 + (-f64::from(*x)).exp())).collect::<Vec<_>>()
    };
    assert_near("mean of two", &color(0), &[0.3, 0.5, 0.7], 1e-6);
    assert_near("no neighbour with a colour", &color(4), &[0.5; 3], 0.0);
}

#[test]
fn the_sky_is_the_upper_half_of_a_sphere() {
    let bounds = Bounds { low: [-10.0, -20.0, -1.0], high: [30.0, 20.0, 5.0] };
    let config = FarConfig { sky_points: 4000, sphere_points: 1000, ..FarConfig::default() };
    let far = far_points(&bounds, &config, 7).expect("a box");
    assert_eq!(far.len(), 5000);
    let centre = [10.0, 0.0, 2.0];
    let mut mean = 0.0;
    for point in &far[1000..] {
        // 4 times the longest edge of 40 m; `f32` at 160 m.
        assert!((distance(*point, centre) - 160.0).abs() < 1e-4 && point[2] >= 2.0, "{point:?}");
        mean += (f64::from(point[2]) - 2.0) / 160.0 / 4000.0;
    }
    // z is uniform in 0..1: its mean is off by 0.29 / sqrt(4000) = 0.005, five times that bounds it.
    assert!((mean - 0.5).abs() < 0.025, "{mean}");
    assert!(far[..1000].iter().all(|point| distance(*point, centre) <= 20.0 + 1e-4));
    assert_eq!(far, far_points(&bounds, &config, 7).expect("a box"));
    assert_ne!(far, far_points(&bounds, &config, 8).expect("a box"));
    assert!((bounds.length(BoxLength::Diagonal) - (1600.0_f64 + 1600.0 + 36.0).sqrt()).abs() < 1e-9);
}

#[test]
fn far_rows_come_last_and_have_their_own_limit() {
    let points = cloud(50, 10.0, 6);
    let far = FarConfig { sky_points: 30, sphere_points: 20, ..FarConfig::default() };
    let config = LiftConfig { far, ..LiftConfig::default() };
    let sky = |point: [f32; 3]| (point[2] > 25.0).then_some([0.0, 0.0, 1.0]);
    let colors = vec![Some([1.0, 0.0, 0.0]); 50];
    let given = LiftInput { far_color: Some(&sky), ..input(&points, &[0.25; 50], &colors) };
    let rows = lift_rows(&given, &config).expect("points");
    assert_eq!((rows.far, rows.times.len(), rows.limits.sky_rows), (50, 100, 30));
    assert!(rows.times[..50].iter().all(|t| *t == 0.25) && rows.times[50..].iter().all(|t| *t == 0.5));
    assert!(rows.limits.near == 1.0 && rows.limits.sky > 5.0, "{:?}", rows.limits);
    let place = &singles()[0];
    let lifted = rows.to_device(&place.device);
    let scales = values(&activate_within(lifted.raw, &lifted.limits).scales());
    assert!(scales[..210].iter().all(|s| *s <= 1.0) && scales[210..].iter().all(|s| *s > 1.0), "scales of the sky");
    assert!(rows.raw[14 * 70..].chunks(14).all(|row| (row[2] > 25.0) == (row[13] > 1.0)), "colours of the sky");
}

#[test]
fn seeds_and_rotations() {
    let points = cloud(20, 1.0, 1);
    let with = |seed: u64, rotations: Rotations| {
        let config = LiftConfig { seed, rotations, ..without_far() };
        lift_rows(&input(&points, &[0.0; 20], &[None; 20]), &config).expect("points").raw
    };
    assert_eq!(with(1, Rotations::Random), with(1, Rotations::Random));
    assert_ne!(with(1, Rotations::Random), with(2, Rotations::Random));
    assert!(with(1, Rotations::Identity).chunks(14).all(|row| row[3..7] == [1.0, 0.0, 0.0, 0.0]));
    // Coincident points keep a scale.
    let rows = lift_rows(&input(&[[1.0; 3]; 9], &[0.0; 9], &[None; 9]), &without_far()).expect("points");
    assert!(rows.raw.iter().all(|x| x.is_finite()));
}

#[test]
fn unusable_points_are_named() {
    let four = [[0.0; 3], [1.0; 3], [2.0; 3], [3.0; 3]];
    let told = |points: &[[f32; 3]], time: f32, color: f32| {
        let (times, colors) = (vec![time; points.len()], vec![Some([color; 3]); points.len()]);
        lift_rows(&input(points, &times, &colors), &without_far()).map(|_| ()).map_err(|error| error.to_string())
    };
    assert_eq!(told(&four, 0.0, 0.5), Ok(()));
    assert_eq!(told(&[], 0.0, 0.5).unwrap_err(), "the number of points for the lift is 0; 4 or more is expected");
    assert_eq!(
        told(&four[..1], 0.0, 0.5).unwrap_err(),
        "the number of points for the lift is 1; 4 or more is expected"
    );
    for bad in [f32::NAN, f32::INFINITY, -f32::INFINITY, 2e5] {
        let mut points = four;
        points[2][1] = bad;
        assert!(told(&points, 0.0, 0.5).unwrap_err().starts_with("point 2 has the coordinates"), "{bad}");
    }
    assert_eq!(told(&four, 1.5, 0.5).unwrap_err(), "a point's time is 1.5; 0 to 1 is expected");
    assert!(
        told(&four, f32::NAN, 0.5).is_err() && told(&four, 0.0, f32::NAN).is_err() && told(&four, 0.0, 2.0).is_err()
    );
    let lengths = lift_rows(&input(&four, &[0.0; 3], &[None; 4]), &without_far());
    assert_eq!(lengths, Err(FluxError::Lengths { what: "times", expected: 4, found: 3 }));
    let flat = lift_rows(&input(&[[1.0; 3]; 4], &[0.0; 4], &[None; 4]), &LiftConfig::default());
    assert!(flat.unwrap_err().to_string().starts_with("the length of the points' box is 0"));
}
