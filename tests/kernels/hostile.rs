//! Whatever goes in, nothing that is not finite comes out, and one bad Gaussian does not touch the others.

use burn::tensor::Tensor;
use gs_burn::ops::ssim::photometric_loss;
use gs_burn::render;
use gs_tests::devices::{Place, everywhere, singles};
use gs_tests::scenes::{COLUMNS, GROUPS, IDENTITY, Random, Scene};
use gs_tests::tolerance::{assert_finite, bits, values};
use proptest::prelude::*;

/// Renders with depth, goes back from everything that came out and from the photometric loss; says what of it is not
/// finite, or an alpha outside 0..1.
fn run(case: &str, scene: &Scene, place: &Place) -> Option<String> {
    let leaves = scene.leaves(place);
    let rendering = render(&leaves.gaussians(), &scene.camera(leaves.viewmat.clone()), &scene.options(true));
    let target = Tensor::zeros(rendering.color.dims(), (&place.device, place.dtype)).autodiff() + 0.5;
    let depth = rendering.depth.clone().unwrap().mean();
    let loss = photometric_loss(rendering.color.clone(), target, 0.2) + rendering.alpha.clone().mean() + depth;
    let alpha = values(&rendering.alpha);
    let mut results = vec![
        ("color", values(&rendering.color)),
        ("expected depth", values(&rendering.expected_depth().unwrap())),
        ("rows", values(&rendering.projected)),
        ("loss", values(&loss)),
    ];
    results.extend(GROUPS.into_iter().zip(leaves.gradients(&loss.backward())));
    let mut wrong: Vec<&str> =
        results.iter().filter(|(_, values)| values.iter().any(|x| !x.is_finite())).map(|(name, _)| *name).collect();
    if !alpha.iter().all(|a| (0.0..=1.0).contains(a)) {
        wrong.push("alpha");
    }
    (!wrong.is_empty()).then(|| format!("{case} on {}: {}", place.name, wrong.join(", ")))
}

/// Fails with all that went wrong: the pattern says more than the first case.
#[track_caller]
fn assert_none(wrong: &[String]) {
    assert!(wrong.is_empty(), "{} cases, the first of them:\n{}", wrong.len(), wrong[..wrong.len().min(20)].join("\n"));
}

#[test]
fn every_extreme_of_every_group() {
    let extremes: [(&str, usize, &[f64]); 6] = [
        ("quats", 1, &[0.0, 1e-30, 1e-19, 1e30, f64::NAN, f64::INFINITY]),
        ("log_scales", 2, &[-69.0, 69.0, 20.0, -30.0, 1e30, f64::NAN, f64::INFINITY, f64::NEG_INFINITY]),
        ("opacity_logits", 3, &[-50.0, 50.0, 1e30, f64::NAN, f64::INFINITY, f64::NEG_INFINITY]),
        ("sh", 4, &[1e4, -1e4, 1e30, -1e30, f64::NAN, f64::INFINITY]),
        ("viewmat", 5, &[0.0, 1e30, f64::NAN, f64::INFINITY]),
        ("background", 6, &[1e30, f64::NAN, f64::NEG_INFINITY]),
    ];
    let mut wrong = Vec::new();
    for place in everywhere() {
        for (name, group, extremes) in extremes {
            for extreme in extremes {
                // In every entry, and in every third: needles, half-broken rows.
                for every in [1, 3] {
                    let mut scene = Scene::random(12, 1).resized(33, 20);
                    scene.groups_mut()[group].iter_mut().step_by(every).for_each(|x| *x = *extreme);
                    wrong.extend(run(&format!("{name} {extreme} in every {every}"), &scene, place));
                }
            }
        }
    }
    assert_none(&wrong);
}

#[test]
fn any_place_about_the_camera() {
    let mut wrong = Vec::new();
    for place in everywhere() {
        for z in [0.0, 1e-7, -1e-7, 1e-30, 0.01, 0.01 - 1e-9, 0.010001, -3.0, 1e8, 1e30, f64::NAN] {
            for x in [0.0, 0.01, 3.0, 1e30, f64::INFINITY] {
                for size in [-69.0, -3.0, 1.0] {
                    let mut scene = Scene::random(4, 2).resized(20, 18);
                    scene.viewmat = IDENTITY.to_vec();
                    scene.means.chunks_mut(3).for_each(|mean| mean.copy_from_slice(&[x, 0.0, z]));
                    scene.log_scales.iter_mut().step_by(2).for_each(|s| *s = size);
                    wrong.extend(run(&format!("x = {x}, z = {z}, size {size}"), &scene, place));
                }
            }
        }
    }
    assert_none(&wrong);
}

#[test]
fn any_size_of_image() {
    let mut wrong = Vec::new();
    for place in everywhere() {
        for [width, height] in [[1, 1], [1, 33], [33, 1], [16, 16], [15, 17], [112, 80], [109, 77]] {
            for count in [0, 1, 30] {
                let scene = Scene::random(count, 3).resized(width, height);
                wrong.extend(run(&format!("{count} Gaussians in {width}x{height}"), &scene, place));
            }
        }
    }
    assert_none(&wrong);
}

/// The image `[H, W, 5]` and the gradients of a fixed weighting of it by the first five groups, in bits.
fn image_and_gradients(scene: &Scene, place: &Place) -> (Vec<u32>, [Vec<f64>; 7]) {
    let leaves = scene.leaves(place);
    let rendering = render(&leaves.gaussians(), &scene.camera(leaves.viewmat.clone()), &scene.options(true));
    let image = Tensor::cat(vec![rendering.color, rendering.depth.unwrap(), rendering.alpha], 2);
    let shape = image.dims();
    let weights = place.tensor(&Random::new(5).values(shape.iter().product(), -1.0, 1.0), shape).autodiff();
    let gradients = leaves.gradients(&(image.clone() * weights).sum().backward());
    (bits(&image), gradients)
}

#[test]
fn a_bad_gaussian_leaves_the_others_bit_equal() {
    let mut wrong = Vec::new();
    for place in singles() {
        let scene = Scene::random(30, 2);
        for (group, columns) in COLUMNS.into_iter().enumerate() {
            for (at, entry, bad) in [(0, 0, f64::NAN), (17, 47, f64::INFINITY), (29, 1, f64::NEG_INFINITY)] {
                // An infinite logit is an opacity of exactly 0 or 1 and an infinitely small scale is a point: both
                // legal.
                let legal = (group == 3 && bad.is_infinite()) || (group == 2 && bad == f64::NEG_INFINITY);
                let mut with = scene.clone();
                with.groups_mut()[group][at * columns + entry % columns] = if legal { f64::NAN } else { bad };
                let mut fail =
                    |what| wrong.push(format!("{bad} in {} of {at} on {}: {what}", GROUPS[group], place.name));
                let (image, gradients) = image_and_gradients(&with, place);
                let (image_without, gradients_without) = image_and_gradients(&scene.clone().without(at), place);
                if image != image_without {
                    fail("the image changed".to_owned());
                }
                for (k, columns) in COLUMNS.into_iter().enumerate() {
                    let mut gradient = gradients[k].clone();
                    let own: Vec<f64> = gradient.drain(at * columns..(at + 1) * columns).collect();
                    if own.iter().any(|g| *g != 0.0) {
                        fail(format!("it received {own:?} by {}", GROUPS[k]));
                    }
                    if gradient.iter().zip(&gradients_without[k]).any(|(a, b)| a.to_bits() != b.to_bits()) {
                        fail(format!("another's gradient by {} changed", GROUPS[k]));
                    }
                }
            }
        }
    }
    assert_none(&wrong);
}

fn strange() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => -3.0..3.0,
        3 => prop::sample::select(vec![0.0, -0.0, 69.0, -69.0, 1e4, 1e-30, -1e-30, 1e30]),
        2 => prop::sample::select(vec![f64::from(f32::MAX), f64::from(f32::MIN_POSITIVE), f64::NAN, f64::INFINITY,
            f64::NEG_INFINITY]),
    ]
}

proptest! {
    // The kernels' own tests run many more cases; here it is the way through Burn, on every device.
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_numbers_give_finite_results(
        numbers in prop::collection::vec(strange(), 59 * 12),
        width in 1_u32..40, height in 1_u32..40, antialiased: bool,
    ) {
        let mut scene = Scene::random(12, 1);
        let mut numbers = numbers.into_iter();
        for group in scene.groups_mut().into_iter().take(5) {
            group.iter_mut().for_each(|x| *x = numbers.next().unwrap());
        }
        // Half of the centres stay in view, or culling would hide the rest.
        scene.means.chunks_mut(3).step_by(2).for_each(|mean| mean.copy_from_slice(&[0.1, -0.1, 2.0]));
        (scene.config.width, scene.config.height, scene.config.antialiased) = (width, height, antialiased);
        for place in everywhere() {
            let wrong = run(&format!("{width}x{height}"), &scene, place);
            prop_assert!(wrong.is_none(), "{}", wrong.unwrap());
        }
    }

    #[test]
    fn the_loss_of_any_images_is_finite(numbers in prop::collection::vec(strange(), 2 * 13 * 7 * 3)) {
        let (image, target) = numbers.split_at(13 * 7 * 3);
        for place in everywhere() {
            let image = place.leaf(image, [7, 13, 3]);
            let loss = photometric_loss(image.clone(), place.tensor(target, [7, 13, 3]).autodiff(), 0.2);
            assert_finite(&format!("loss on {}", place.name), &values(&loss));
            let gradient = image.grad(&loss.backward()).unwrap();
            assert_finite(&format!("gradient on {}", place.name), &values(&gradient));
        }
    }
}
