//! Depth priors: alignment undoes any affine map, in the right space, outliers or not; the losses are their formulas.

use burn::tensor::Tensor;
use gs_models::depth_prior::{DEPTH_EPSILON, DepthSpace, align, depth_correlation_loss, depth_loss};
use gs_tests::devices::{Place, everywhere};
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_finite, assert_near, values};

const PIXELS: usize = 3000;

/// True depths of a room, 2 to 9 scene units.
fn truth(random: &mut Random) -> Vec<f32> {
    (0..PIXELS).map(|_| random.uniform(2.0, 9.0) as f32).collect()
}

fn in_space(depth: f32, space: DepthSpace) -> f64 {
    match space {
        DepthSpace::Depth => f64::from(depth),
        DepthSpace::InverseDepth => 1.0 / f64::from(depth),
    }
}

const SPACES: [DepthSpace; 2] = [DepthSpace::Depth, DepthSpace::InverseDepth];
const AFFINE: [[f64; 2]; 4] = [[1.0, 0.0], [0.02, 5.0], [40.0, -3.0], [700.0, 90.0]];

/// Largest relative error of the aligned depths where `good`.
fn error(found: &[f32], truth: &[f32], good: impl Fn(usize) -> bool) -> f64 {
    let off = |i: usize| (f64::from(found[i]) / f64::from(truth[i]) - 1.0).abs();
    (0..truth.len()).filter(|i| good(*i)).map(off).fold(0.0, f64::max)
}

#[test]
fn every_affine_map_is_undone() {
    for space in SPACES {
        for [scale, shift] in AFFINE {
            let depths = truth(&mut Random::new(1));
            let prior: Vec<f32> = depths.iter().map(|z| (in_space(*z, space) * scale + shift) as f32).collect();
            let found = align(&prior, &depths, None, space).expect("a clean prior");
            let error = error(&found.depth(&prior), &depths, |_| true);
            // Rounding of the stored prior: 6e-8 of its shift, over its own spread.
            assert!(error < 2e-4, "{space:?} {scale} {shift}: off by {error}");
            assert_eq!(found.inliers, 1.0, "{space:?} {scale} {shift}");
        }
    }
}

#[test]
fn a_fifth_of_outliers_and_noise_change_little() {
    for space in SPACES {
        for [scale, shift] in AFFINE {
            let mut random = Random::new(2);
            let depths = truth(&mut random);
            let clean: Vec<f64> = depths.iter().map(|z| in_space(*z, space)).collect();
            let spread = clean.iter().fold(0.0_f64, |a, b| a.max(*b)) - clean.iter().fold(f64::MAX, |a, b| a.min(*b));
            let wrong: Vec<bool> = (0..PIXELS).map(|i| i % 5 == 0).collect();
            let prior: Vec<f32> = (0..PIXELS)
                .map(|i| {
                    // One-sided, as sky and glass are.
                    let off =
                        if wrong[i] { random.uniform(0.5, 2.0) * spread } else { random.uniform(-0.01, 0.01) * spread };
                    ((clean[i] + off) * scale + shift) as f32
                })
                .collect();
            let found = align(&prior, &depths, None, space).expect("a usable prior");
            let slope = found.scale * scale;
            let offset = found.shift + found.scale * shift;
            assert!((slope - 1.0).abs() < 0.005, "{space:?} {scale} {shift}: scale off by a factor {slope}");
            assert!(offset.abs() < 0.005 * spread, "{space:?} {scale} {shift}: shift off by {offset} of {spread}");
            assert!((found.inliers - 0.8).abs() < 0.05, "{space:?}: {} inliers", found.inliers);
        }
    }
}

/// The same prior aligned in the other space is bent: the test above is not blind to the space.
#[test]
fn the_wrong_space_does_not_fit() {
    let depths = truth(&mut Random::new(3));
    let prior: Vec<f32> = depths.iter().map(|z| 3.0 / z + 0.1).collect();
    let right = align(&prior, &depths, None, DepthSpace::InverseDepth).expect("a clean prior");
    assert!(error(&right.depth(&prior), &depths, |_| true) < 1e-3);
    assert!(align(&prior, &depths, None, DepthSpace::Depth).is_none(), "near and far are the other way round");
}

#[test]
fn weights_count_and_unknown_pixels_do_not() {
    let mut random = Random::new(4);
    let mut depths = truth(&mut random);
    let mut prior: Vec<f32> = depths.iter().map(|z| z * 2.0 + 1.0).collect();
    let weights: Vec<f32> = (0..PIXELS).map(|i| if i % 2 == 0 { 1.0 } else { 0.0 }).collect();
    for i in (1..PIXELS).step_by(2) {
        depths[i] = 100.0;
    }
    prior[0] = f32::NAN;
    prior[2] = 0.0;
    depths[4] = 0.0;
    depths[6] = f32::INFINITY;
    let found = align(&prior, &depths, Some(&weights), DepthSpace::Depth).expect("half are right");
    assert!((found.scale - 0.5).abs() < 1e-5 && (found.shift + 0.5).abs() < 1e-4, "{found:?}");
    let aligned = found.depth(&prior);
    assert_eq!([aligned[0], aligned[2]], [0.0, 0.0]);
}

#[test]
fn priors_that_say_nothing_are_refused() {
    let depths = truth(&mut Random::new(5));
    let space = DepthSpace::Depth;
    assert!(align(&vec![3.0; PIXELS], &depths, None, space).is_none(), "a flat prior");
    assert!(align(&[0.0; 100], &depths[..100], None, space).is_none(), "an unknown prior");
    assert!(align(&depths[..10], &depths[..10], None, space).is_none(), "ten pixels");
    let reversed: Vec<f32> = depths.iter().map(|z| -z).collect();
    assert!(align(&reversed, &depths, None, space).is_none(), "near for far");
    assert!(align(&[], &[], None, space).is_none(), "nothing");
}

#[test]
fn the_loss_is_its_equation() {
    for place in everywhere() {
        let e = DEPTH_EPSILON;
        let rendered = place.tensor(&[2.0, 0.0, 3.0, 1.0], [2, 2, 1]);
        let prior = place.tensor(&[1.0, 4.0, 0.0, 1.0], [2, 2, 1]);
        let expected = ((2.0 + e) / (1.0 + e)).ln() / 4.0;
        assert_near(&place.name, &values(&depth_loss(rendered, prior)), &[expected], 1e-6);
    }
}

#[test]
fn correlation_of_depth_knows_no_scale_and_shift() {
    for place in everywhere() {
        let numbers = Random::new(3).values(6, 1.0, 3.0);
        let rendered = place.leaf(&numbers, [2, 3, 1]);
        let prior =
            |f: &dyn Fn(f64) -> f64| place.tensor(&numbers.iter().map(|z| f(*z)).collect::<Vec<_>>(), [2, 3, 1]);
        let loss = |prior, space| depth_correlation_loss(rendered.clone(), prior, space);
        let near = |found: Tensor<1>, expected| assert_near(&place.name, &values(&found), &[expected], 1e-5);
        near(loss(prior(&|z| 0.3 * z + 2.0), DepthSpace::Depth), 0.0);
        near(loss(prior(&|z| 5.0 / z - 0.1), DepthSpace::InverseDepth), 0.0);
        near(loss(prior(&|z| 9.0 - z), DepthSpace::Depth), 2.0);
        near(loss(prior(&|_| 1.0), DepthSpace::Depth), 0.0);
        // The other space bends it, and the gradient says how.
        let bent = loss(prior(&|z| 1.0 / z), DepthSpace::Depth);
        let gradients = bent.backward();
        let gradient = values(&rendered.grad(&gradients).expect("tracked"));
        assert!(gradient.iter().all(|g| g.is_finite()) && gradient.iter().any(|g| *g != 0.0), "{}", place.name);
        let flat = place.leaf(&[2.0; 6], [2, 3, 1]);
        let gradients = depth_correlation_loss(flat.clone(), prior(&|z| z), DepthSpace::Depth).backward();
        assert_finite(&place.name, &values(&flat.grad(&gradients).expect("tracked")));
    }
}

#[test]
fn depth_gradients_stay_finite_where_nothing_is_known() {
    fn check(place: &Place) {
        let numbers = Random::new(1).values(6, 0.0, 3.0);
        let rendered = place.leaf(&[0.0, 0.0, numbers[0], numbers[1], numbers[2], 1e-6], [2, 3, 1]);
        let prior = place.tensor(&[0.0, 1.0, 0.0, numbers[3], 2.0, 5.0], [2, 3, 1]);
        let gradients = depth_loss(rendered.clone(), prior).backward();
        let gradient = values(&rendered.grad(&gradients).expect("tracked"));
        assert_finite(&place.name, &gradient);
        assert!(gradient[..3].iter().all(|g| *g == 0.0), "{}: unknown pixels pull", place.name);
        assert!(gradient[3..].iter().all(|g| *g != 0.0), "{}: known pixels do not pull", place.name);
    }
    everywhere().for_each(check);
}
