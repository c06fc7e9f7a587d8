//! Eq. 2.

use gs_models::flux4d::PolynomialMotion;
use gs_tests::devices::{everywhere, reference};
use gs_tests::finite_differences::assert_derivatives;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_near, values};

#[test]
fn displacements_are_the_equation() {
    for place in everywhere() {
        let motion = PolynomialMotion::new(2).expect("a degree");
        let velocity = place.tensor(&[1.0, 0.0, -1.0, 0.5, 2.0, 0.0, 0.0, 3.0, 6.0], [1, 9]);
        let shift = motion.displacement(velocity.clone(), place.tensor(&[0.5], [1]), 2.0);
        // j = 0: 1.5; j = 1: (4 - 0.25) / 2 = 1.875; j = 2: (8 - 0.125) / 3 = 2.625. All exact in `f32`.
        let expected = [1.5 + 0.5 * 1.875, 2.0 * 1.875 + 3.0 * 2.625, -1.5 + 6.0 * 2.625];
        assert_near(&place.name, &values(&shift), &expected, 1e-6);
        let speed = motion.velocity(velocity, 2.0);
        assert_near(&place.name, &values(&speed), &[1.0 + 1.0, 4.0 + 12.0, -1.0 + 24.0], 1e-6);
        let second = PolynomialMotion::per_second(speed, 0.5);
        assert_near("m/s", &values(&second), &[4.0, 32.0, 46.0], 1e-6);
    }
}

#[test]
fn nothing_moves_at_its_own_time() {
    for place in everywhere() {
        let times: Vec<f64> = (0..50).map(|i| f64::from(i as f32 / 49.0)).collect();
        for degree in 0..=3 {
            let motion = PolynomialMotion::new(degree).expect("a degree");
            let columns = motion.columns();
            let velocity = place.tensor(&Random::new(2).values(50 * columns, -30.0, 30.0), [50, columns]);
            for (row, t) in times.iter().enumerate() {
                let shift = motion.displacement(velocity.clone(), place.tensor(&times, [50]), *t);
                assert_eq!(values(&shift)[3 * row..3 * row + 3], [0.0; 3], "{} degree {degree} at {t}", place.name);
            }
        }
    }
}

#[test]
fn velocity_is_the_slope_and_gradients_are_differences() {
    let place = reference();
    let mut random = Random::new(3);
    let motion = PolynomialMotion::new(3).expect("a degree");
    let (velocity, times) = (random.values(60, -5.0, 5.0), random.values(5, 0.0, 1.0));
    let at = |t: f64| motion.displacement(place.tensor(&velocity, [5, 12]), place.tensor(&times, [5]), t);
    let h = 1e-5;
    let slope = (at(0.7 + h) - at(0.7 - h)) / (2.0 * h);
    // A central difference of a quartic: h^2 times its third derivative (100), and rounding over h.
    assert_near("velocity", &values(&motion.velocity(place.tensor(&velocity, [5, 12]), 0.7)), &values(&slope), 1e-8);

    let arguments: [(&str, &[f64]); 2] = [("velocity", &velocity), ("times", &times)];
    assert_derivatives("displacement", place, arguments, 60, |[velocity, times]| {
        motion.displacement(velocity.reshape([5, 12]), times, 1.4).sin().sum()
    });
}

#[test]
fn a_degree_above_three_is_refused() {
    assert_eq!(
        PolynomialMotion::new(4).unwrap_err().to_string(),
        "the degree of the velocity is 4; 0 to 3 is expected"
    );
    let motion: PolynomialMotion = serde_json::from_str("1").expect("a degree");
    assert_eq!((motion.degree(), motion.columns()), (1, 6));
    assert!(serde_json::from_str::<PolynomialMotion>("4").is_err());
}

/// One row on the host and as tensors.
#[test]
fn the_host_and_the_tensors_shift_alike() {
    let motion = PolynomialMotion::new(2).expect("a degree");
    let velocity = [0.4, -1.0, 0.2, 0.3, 0.5, -0.7, 1.2, -0.1, 0.6];
    let place = reference();
    let own = place.tensor(&[0.3], [1]);
    let by_tensor = motion.displacement(place.tensor(&velocity, [1, 9]), own, 0.8);
    let by_tensor: Vec<f64> = by_tensor.to_data().iter::<f64>().collect();
    for (a, b) in by_tensor.iter().zip(motion.shift(&velocity, 0.3, 0.8)) {
        assert!((a - b).abs() < 1e-12, "{a} and {b}");
    }
}
