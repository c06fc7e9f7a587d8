//! `gs_burn::exposure`.

use gs_burn::{ExposureOptions, ExposureRendering, Gaussians, MovingSample, Rendering, render, render_exposure};
use gs_tests::devices::{Place, everywhere, singles};
use gs_tests::exposure::{Moving, image};
use gs_tests::scenes::Scene;
use gs_tests::tolerance::{assert_finite, assert_near, assert_near_scaled, bits, values};

/// Means of a few renderings of order 1 (depth: of order 5, and scaled). Single precision loses 6e-8 an operation of
/// which there are about ten; the knees of the curve of sRGB are rounded to 3e-8 by the standard.
const MEAN: f64 = 1e-6;

fn exposure(case: &Moving, place: &Place, options: &ExposureOptions) -> ExposureRendering {
    case.exposure(&case.scene.leaves(place), &case.samples(place), options, None)
}

fn cases() -> Vec<(&'static str, Moving)> {
    let mut antialiased = Moving::random(150, 6, 3, 0.05, 8);
    antialiased.scene.config.antialiased = true;
    vec![
        ("some move", Moving::random(200, 7, 5, 0.05, 1)),
        ("few move far", Moving::random(200, 60, 4, 0.5, 2)),
        ("all move", Moving::random(60, 1, 4, 0.1, 3)),
        ("nothing moves", Moving::random(60, 61, 3, 0.1, 4)),
        ("one instant", Moving::random(60, 3, 1, 0.1, 5)),
        ("one Gaussian", Moving::random(1, 1, 3, 0.3, 6)),
        ("empty", Moving::random(0, 1, 3, 0.3, 7)),
        ("anti-aliased", antialiased),
    ]
}

#[test]
fn mean_of_renderings() {
    for (name, case) in cases() {
        for place in everywhere() {
            let leaves = case.scene.leaves(place);
            let each = case.each(&leaves, &case.samples(place), None);
            for linear in [false, true] {
                let actual = values(&image(&exposure(&case, place, &case.options(linear))));
                let expected = values(&case.mean(&each, linear));
                assert_near_scaled(&format!("{name}, light {linear}, on {}", place.name), &actual, &expected, MEAN);
            }
        }
    }
}

/// Before anything is averaged the pixels are those of a rendering, bit for bit; so the mean of equal instants is one.
#[test]
fn bits_of_a_rendering() {
    for place in singles() {
        let mut case = Moving::random(200, 7, 4, 0.05, 9);
        let options = case.options(false);
        let render_at = |case: &Moving, k: usize| {
            let leaves = case.scene.leaves(place);
            let gaussians = case.at(&leaves, &case.samples(place)[k]);
            render(&gaussians, &case.scene.camera(leaves.viewmat.clone()), &options.render)
        };
        let same = |what: &str, actual: &Rendering, expected: &Rendering| {
            let depths = |rendering: &Rendering| bits(&rendering.depth.clone().expect("depth was asked for"));
            assert!(bits(&actual.color) == bits(&expected.color), "{what}: colour on {}", place.name);
            assert!(bits(&actual.alpha) == bits(&expected.alpha), "{what}: alpha on {}", place.name);
            assert!(depths(actual) == depths(expected), "{what}: depth on {}", place.name);
            assert!(bits(&actual.projected) == bits(&expected.projected), "{what}: rows on {}", place.name);
        };
        let middle = exposure(&case, place, &options).middle();
        same("the middle instant", &middle, &render_at(&case, 2));

        // Sums of four equal numbers are exact.
        case.means.iter_mut().for_each(|means| means.clone_from(&[0.0; 3].repeat(means.len() / 3)));
        for k in 0..4 {
            case.means[k].iter_mut().enumerate().for_each(|(i, x)| *x = 0.1 * (i % 7) as f64 - 0.3 + (i % 3) as f64);
            case.quats[k] = case.quats[0].clone();
        }
        let rendering = exposure(&case, place, &options);
        let expected = render_at(&case, 0);
        assert!(bits(&rendering.color) == bits(&expected.color), "equal instants on {}", place.name);
        assert!(rendering.tiles.get() > rendering.full_tiles / 4, "the movers touch tiles");
    }
}

#[test]
fn still_tiles_are_drawn_once() {
    for place in singles() {
        let case = Moving::random(200, 60, 6, 0.01, 10);
        let rendering = exposure(&case, place, &case.options(true));
        let (tiles, full) = (rendering.tiles.get(), rendering.full_tiles);
        assert_eq!(full, 6 * 8 * 6);
        assert!(tiles > full / 6 && tiles < full / 2, "{tiles} tiles drawn of {full} on {}", place.name);
    }
}

#[test]
fn radii_are_the_largest_over_the_instants() {
    for place in everywhere() {
        let case = Moving::random(100, 5, 4, 0.3, 11);
        let leaves = case.scene.leaves(place);
        let mut expected = vec![0.0_f64; 100];
        for sample in case.samples(place) {
            let camera = case.scene.camera(leaves.viewmat.clone());
            let radii = values(&render(&case.at(&leaves, &sample), &camera, &case.options(false).render).radii());
            expected.iter_mut().zip(radii).for_each(|(largest, radius)| *largest = largest.max(radius));
        }
        let radii = values(&exposure(&case, place, &case.options(false)).radii());
        // The difference of two radii is rounded.
        assert_near_scaled(&place.name, &radii, &expected, MEAN);
    }
}

/// A Gaussian that does not move is not asked where it would be, a mover that is nowhere is not drawn, and off screen
/// is as nowhere.
#[test]
fn rows_that_are_not_finite_or_out_of_sight() {
    for place in everywhere() {
        let case = Moving::random(100, 5, 3, 0.05, 12);
        let expected = values(&image(&exposure(&case, place, &case.options(true))));
        let mut unused = case.clone();
        for &row in &case.moving {
            unused.scene.means[3 * row as usize..][..3].fill(f64::NAN);
            unused.scene.quats[4 * row as usize..][..4].fill(f64::INFINITY);
        }
        let actual = values(&image(&exposure(&unused, place, &case.options(true))));
        assert_near(&format!("unused rows on {}", place.name), &actual, &expected, 0.0);

        let out = |value: [f64; 3]| {
            let mut gone = case.clone();
            gone.means[1].chunks_mut(3).for_each(|mean| mean.copy_from_slice(&value));
            let rendering = exposure(&gone, place, &case.options(true));
            assert_finite(&place.name, &values(&rendering.radii()));
            values(&image(&rendering))
        };
        let behind = out([0.0, 0.0, -5.0]);
        assert_finite(&place.name, &behind);
        for value in [[f64::NAN; 3], [f64::INFINITY, 0.0, 3.0], [1e30; 3], [500.0, 0.0, 3.0]] {
            assert_near(&format!("at {value:?} on {}", place.name), &out(value), &behind, 0.0);
        }
    }
}

#[test]
fn one_two_or_seven_threads() {
    for place in singles() {
        let case = Moving::random(1500, 7, 5, 0.05, 13);
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be started");
            pool.install(|| {
                let leaves = case.scene.leaves(place);
                let samples = case.samples(place);
                let image = image(&case.exposure(&leaves, &samples, &case.options(true), None));
                let gradients = (image.clone() * image.clone()).sum().backward();
                let means = samples[0].means.grad(&gradients).expect("the sample was tracked");
                let mut all = vec![bits(&image), bits(&means)];
                all.extend(leaves.gradients(&gradients).map(|g| g.iter().map(|x| (*x as f32).to_bits()).collect()));
                all
            })
        };
        let one = with(1);
        for threads in [2, 7] {
            assert!(one == with(threads), "{threads} threads on {}", place.name);
        }
    }
}

/// On a device that does not track, as an evaluation renders.
#[test]
fn without_gradients() {
    for place in everywhere() {
        let case = Moving::random(60, 5, 3, 0.05, 15);
        let expected = values(&image(&exposure(&case, place, &case.options(true))));
        let (count, movers) = (case.scene.count(), case.moving.len());
        let Scene { means, quats, log_scales, opacity_logits, sh, viewmat, .. } = &case.scene;
        let gaussians = Gaussians::from_tensors(
            place.tensor(means, [count, 3]),
            place.tensor(quats, [count, 4]),
            place.tensor(log_scales, [count, 3]),
            place.tensor(opacity_logits, [count]),
            place.tensor(sh, [count, 16, 3]),
        );
        let sample = |(means, quats): (&Vec<f64>, &Vec<f64>)| MovingSample {
            means: place.tensor(means, [movers, 3]),
            quats: place.tensor(quats, [movers, 4]),
        };
        let samples: Vec<MovingSample> = case.means.iter().zip(&case.quats).map(sample).collect();
        let camera = case.scene.camera(place.tensor(viewmat, [4, 4]));
        let rendering = render_exposure(&gaussians, &case.moving, &samples, &camera, &case.options(true), None);
        assert_near(&place.name, &values(&image(&rendering)), &expected, 0.0);
        assert_eq!(rendering.radii().dims(), [count]);
    }
}

#[test]
#[should_panic(expected = "must rise")]
fn movers_out_of_order() {
    let mut case = Moving::random(20, 5, 2, 0.1, 14);
    case.moving.reverse();
    exposure(&case, &singles()[0], &case.options(false));
}
