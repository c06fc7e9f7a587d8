//! `gs_burn::ops::noise`.

use gs_burn::ops::noise::{NoiseConfig, perturb};
use gs_tests::devices::{everywhere, reference};
use gs_tests::scenes::Random;
use gs_tests::tolerance::{FORWARD_F32, FORWARD_F64, assert_near, values};

const COUNT: usize = 700;

/// Means, quats, log scales and logits, the last on both sides of the gate.
fn inputs() -> [Vec<f64>; 4] {
    let mut random = Random::new(21);
    [
        random.values(3 * COUNT, -1.0, 1.0),
        random.values(4 * COUNT, -1.0, 1.0),
        random.values(3 * COUNT, -2.0, 0.0),
        random.values(COUNT, -9.0, -1.0),
    ]
}

fn moved(inputs: &[Vec<f64>; 4], place: &gs_tests::devices::Place, config: &NoiseConfig) -> Vec<f64> {
    let [means, quats, log_scales, logits] = inputs;
    values(&perturb(
        place.tensor(means, [COUNT, 3]),
        place.tensor(quats, [COUNT, 4]),
        place.tensor(log_scales, [COUNT, 3]),
        place.tensor(logits, [COUNT]),
        config,
    ))
}

/// Words are equal to the bit everywhere; the normal numbers made of them, of order 1, follow the `ln`, `sin` and `cos`
/// of the device, of which WGSL promises 2^-11 absolute for the last two.
const NORMALS_F32: f64 = 1e-3;

#[test]
fn every_device_draws_the_same() {
    let (inputs, config) = (inputs(), NoiseConfig::new(1.0, 99, 1234));
    let expected = moved(&inputs, reference(), &config);
    assert!(expected.iter().zip(&inputs[0]).filter(|(a, b)| a != b).count() > COUNT, "a third or more is moved");
    assert!(expected.iter().zip(&inputs[0]).any(|(a, b)| a == b), "closed gates move nothing");
    for place in everywhere() {
        let bound = if place.is_double() { FORWARD_F64 } else { NORMALS_F32.max(FORWARD_F32) };
        assert_near(&place.name, &moved(&inputs, place, &config), &expected, bound);
    }
}

#[test]
fn what_is_not_finite_stays() {
    for place in everywhere() {
        let mut inputs = inputs();
        inputs[1][4..8].fill(0.0);
        inputs[2][7] = f64::NAN;
        inputs[2][10] = 1e30;
        inputs[3][..20].fill(-8.0);
        inputs[3][5] = f64::NAN;
        let after = moved(&inputs, place, &NoiseConfig::new(1.0, 3, 1));
        for row in [1, 2, 3, 5] {
            let before: Vec<f64> = values(&place.tensor(&inputs[0][3 * row..3 * row + 3], [3]));
            assert_eq!(after[3 * row..3 * row + 3], before, "row {row} on {}", place.name);
        }
        assert!(after.iter().all(|x| x.is_finite()), "{}", place.name);
    }
}
