//! `gs_burn::ops::noise`.

use gs_burn::Gaussians;
use gs_burn::ops::noise::{NoiseConfig, perturb, perturb_reference};
use gs_tests::devices::{Place, everywhere, reference};
use gs_tests::scenes::Random;
use gs_tests::tolerance::{FORWARD_F32, assert_near, values};

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

fn gaussians([means, quats, log_scales, logits]: &[Vec<f64>; 4], place: &Place) -> Gaussians {
    Gaussians::from_tensors(
        place.tensor(means, [COUNT, 3]),
        place.tensor(quats, [COUNT, 4]),
        place.tensor(log_scales, [COUNT, 3]),
        place.tensor(logits, [COUNT]),
        place.tensor(&[0.0; 3 * COUNT], [COUNT, 1, 3]),
    )
}

fn moved(inputs: &[Vec<f64>; 4], place: &Place, config: &NoiseConfig) -> Vec<f64> {
    let Gaussians { means, quats, log_scales, opacity_logits, .. } = gaussians(inputs, place);
    values(&perturb(means.val(), quats.val(), log_scales.val(), opacity_logits.val(), config))
}

/// Words are equal to the bit everywhere; the normal numbers made of them, of order 1, follow the `ln`, `sin` and `cos`
/// of the device, of which WGSL promises 2^-11 absolute for the last two.
const NORMALS_F32: f64 = 1e-3;

#[test]
fn every_device_draws_the_same() {
    let (inputs, config) = (inputs(), NoiseConfig::new(1.0, 99, 1234));
    let expected = values(&perturb_reference(&gaussians(&inputs, reference()), &config));
    assert!(expected.iter().zip(&inputs[0]).filter(|(a, b)| a != b).count() > COUNT, "a third or more is moved");
    assert!(expected.iter().zip(&inputs[0]).any(|(a, b)| a == b), "closed gates move nothing");
    for place in everywhere() {
        // The same operations in another order: a few times 1e-16 of numbers of order 1.
        let bound = if place.is_double() { 1e-12 } else { NORMALS_F32.max(FORWARD_F32) };
        let drawn = moved(&inputs, place, &config);
        assert_near(&place.name, &drawn, &expected, bound);
        assert_eq!(moved(&inputs, place, &config), drawn, "again on {}", place.name);
        let other = moved(&inputs, place, &NoiseConfig { step: config.step + 1, ..config });
        let change = other.iter().zip(&drawn).fold(0.0_f64, |most, (a, b)| most.max((a - b).abs()));
        assert!(change > 1e-3, "another step, other noise on {}", place.name);
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
