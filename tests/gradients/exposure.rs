//! `gs_burn::exposure`, from a loss over colour, alpha and depth to every parameter, the samples, the pose and the
//! screen.

use burn::tensor::Tensor;
use gs_tests::devices::{Place, bounded, reference, singles};
use gs_tests::exposure::{Moving, image};
use gs_tests::finite_differences::assert_derivative;
use gs_tests::scenes::{GROUPS, Random};
use gs_tests::tolerance::{GRADIENT_F32, GRADIENT_F64, assert_gradient, assert_near, largest, values};

/// Smooth weights over the image: gradients of both signs in every channel.
fn loss(case: &Moving, image: Tensor<3>, place: &Place) -> Tensor<1> {
    let dims = image.dims();
    let weights = Random::new(3).values(dims.iter().product(), -1.0, 1.0);
    let scale = 1.0 / case.scene.count().max(1) as f64;
    (image * place.tensor(&weights, dims).autodiff()).sum() * scale
}

/// Gradients by the groups of the scene, by each sample's rows, and the screen statistic.
fn gradients(case: &Moving, linear: bool, shared: bool, place: &Place) -> Vec<(String, Vec<f64>)> {
    let (leaves, samples) = (case.scene.leaves(place), case.samples(place));
    let screen = place.leaf(&vec![0.0; 4 * case.scene.count()], [case.scene.count(), 4]);
    let output = if shared {
        image(&case.exposure(&leaves, &samples, &case.options(linear), Some(screen.clone())))
    } else {
        case.mean(&case.each(&leaves, &samples, Some(&screen)), linear)
    };
    let gradients = loss(case, output, place).backward();
    let mut all: Vec<(String, Vec<f64>)> =
        GROUPS[..6].iter().map(ToString::to_string).zip(leaves.gradients(&gradients)).collect();
    for (k, sample) in samples.iter().enumerate() {
        for (name, leaf) in [("means", &sample.means), ("quats", &sample.quats)] {
            let gradient = leaf.grad(&gradients).map_or_else(Vec::new, |gradient| values(&gradient));
            all.push((format!("{name} of sample {k}"), gradient));
        }
    }
    all.push(("screen".to_owned(), values(&screen.grad(&gradients).expect("the screen was tracked"))));
    all
}

fn compare(name: &str, case: &Moving, linear: bool, place: &Place, bound: f64) {
    let expected = gradients(case, linear, false, place);
    let actual = gradients(case, linear, true, place);
    for ((group, actual), (_, expected)) in actual.iter().zip(&expected) {
        let what = format!("{name}, light {linear}, {group} on {}", place.name);
        if largest(expected) == 0.0 {
            assert_near(&what, actual, expected, 0.0);
        } else {
            assert_gradient(&what, actual, expected, bound);
        }
    }
}

fn cases() -> Vec<(&'static str, Moving)> {
    let mut antialiased = Moving::random(120, 6, 3, 0.05, 28);
    antialiased.scene.config.antialiased = true;
    vec![
        ("some move", Moving::random(150, 7, 5, 0.05, 21)),
        ("few move far", Moving::random(150, 40, 4, 0.4, 22)),
        ("all move", Moving::random(60, 1, 3, 0.1, 23)),
        ("one instant", Moving::random(60, 3, 1, 0.1, 25)),
        ("anti-aliased", antialiased),
    ]
}

#[test]
fn those_of_one_rendering_an_instant() {
    for (name, case) in cases() {
        for linear in [false, true] {
            for (place, bound) in bounded(GRADIENT_F64, GRADIENT_F32) {
                compare(name, &case, linear, place, bound);
            }
        }
    }
}

/// The unused centres of what moves receive exactly zero, whatever they are.
#[test]
fn rows_that_are_not_used_get_nothing() {
    for place in singles() {
        let mut case = Moving::random(60, 5, 3, 0.1, 26);
        for &row in &case.moving {
            case.scene.means[3 * row as usize..][..3].fill(f64::NAN);
        }
        let all = gradients(&case, true, true, place);
        let (_, means) = &all[0];
        for &row in &case.moving {
            assert_eq!(means[3 * row as usize..][..3], [0.0; 3], "row {row} on {}", place.name);
        }
        assert!(all.iter().all(|(_, gradient)| gradient.iter().all(|x| x.is_finite())), "on {}", place.name);
    }
}

#[test]
fn derivative_of_the_loss_by_the_samples() {
    let place = reference();
    let case = Moving::random(25, 4, 3, 0.1, 27);
    let evaluate = |case: &Moving| {
        let (leaves, samples) = (case.scene.leaves(place), case.samples(place));
        (loss(case, image(&case.exposure(&leaves, &samples, &case.options(true), None)), place), samples)
    };
    let (value, samples) = evaluate(&case);
    let gradients = value.backward();
    for k in 0..3 {
        let by_means = values(&samples[k].means.grad(&gradients).expect("tracked"));
        let by_quats = values(&samples[k].quats.grad(&gradients).expect("tracked"));
        let single = |x: &[f64], at: fn(&mut Moving) -> &mut Vec<Vec<f64>>| {
            let mut moved = case.clone();
            at(&mut moved)[k] = x.to_vec();
            values(&evaluate(&moved).0)[0]
        };
        assert_derivative("means", &case.means[k], &by_means, 9, |x| single(x, |case| &mut case.means));
        assert_derivative("quats", &case.quats[k], &by_quats, 8, |x| single(x, |case| &mut case.quats));
    }
}
