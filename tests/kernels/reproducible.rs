//! The same inputs give the same bits: again, and for any number of threads.

use burn::tensor::Tensor;
use gs_burn::ops::ssim::photometric_loss;
use gs_burn::{Extras, render_with};
use gs_tests::devices::{Place, everywhere, singles};
use gs_tests::scenes::{GROUPS, Random, Scene};
use gs_tests::tolerance::values;

/// Gaussians for more tasks of the CPU kernels (2048 each) than the most threads, several tiles and strips.
fn scene() -> Scene {
    Scene::random(8 * 2048, 1).resized(120, 150)
}

/// Image, loss, gradients by every group, screen gradient: names and bits.
fn everything(scene: &Scene, place: &Place) -> Vec<(&'static str, Vec<u64>)> {
    let leaves = scene.leaves(place);
    let screen = place.leaf(&vec![0.0; 4 * scene.count()], [scene.count(), 4]);
    let camera = scene.camera(leaves.viewmat.clone());
    let extras = Extras { screen: Some(screen.clone()), ..Extras::default() };
    let rendering = render_with(&leaves.gaussians(), &camera, &scene.options(true), extras);
    let shape = rendering.color.dims();
    let target: Tensor<3> = place.tensor(&Random::new(2).values(shape.iter().product(), 0.0, 1.0), shape).autodiff();
    let loss = photometric_loss(rendering.color.clone(), target, 0.2);
    let gradients = loss.backward();
    let screen = values(&screen.grad(&gradients).expect("the screen was tracked"));
    assert!(screen.iter().any(|g| *g != 0.0), "the screen gradient on {} is all zero", place.name);
    let wide = |values: Vec<f64>| values.into_iter().map(f64::to_bits).collect();
    // As f64, which holds every f32 exactly.
    let mut all = vec![
        ("color", wide(values(&rendering.color))),
        ("depth", wide(values(&rendering.depth.unwrap()))),
        ("loss", wide(values(&loss))),
        ("screen", wide(screen)),
    ];
    all.extend(GROUPS.into_iter().zip(leaves.gradients(&gradients).map(wide)));
    all
}

#[track_caller]
fn assert_same(case: &str, first: &[(&str, Vec<u64>)], again: &[(&str, Vec<u64>)]) {
    for ((name, first), (_, again)) in first.iter().zip(again) {
        let different = first.iter().zip(again).filter(|(a, b)| a != b).count();
        assert!(different == 0, "{case}: {different} of {} values of {name} differ", first.len());
    }
}

#[test]
fn twenty_times() {
    for place in singles() {
        let scene = Scene::random(200, 3);
        let first = everything(&scene, place);
        for time in 2..=20 {
            assert_same(&format!("time {time} on {}", place.name), &first, &everything(&scene, place));
        }
    }
}

#[test]
fn one_two_or_seven_threads() {
    for place in everywhere() {
        let scene = scene();
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be started");
            pool.install(|| everything(&scene, place))
        };
        let one = with(1);
        for threads in [2, 7] {
            assert_same(&format!("{threads} threads on {}", place.name), &one, &with(threads));
        }
    }
}
