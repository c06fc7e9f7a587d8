//! `gs_burn::ops::sh`.

use burn::tensor::Tensor;
use gs_burn::ops::sh::{sh_colors, sh_colors_reference};
use gs_kernels::rows::PROJECTED;
use gs_tests::devices::{Place, doubles, reference, singles};
use gs_tests::finite_differences::assert_derivative;
use gs_tests::scenes::{GROUPS, Leaves, Random, Scene};
use gs_tests::tolerance::{GRADIENT_F32, GRADIENT_F64, assert_gradient, values};

const COUNT: usize = 30;
const MEANS: usize = 0;
const SH: usize = 4;
const VIEWMAT: usize = 5;

type ShColors = fn(Tensor<2>, Tensor<3>, Tensor<2>, Tensor<2>, usize) -> Tensor<2>;

/// The groups that colours of a degree depend on: the plain colour has no direction.
fn depends_on(degree: usize) -> &'static [usize] {
    if degree == 0 { &[SH] } else { &[MEANS, SH, VIEWMAT] }
}

fn sum(leaves: &Leaves, rows: &[f64], degree: usize, place: &Place, sh_colors: ShColors) -> Tensor<1> {
    let Leaves { means, sh, viewmat, .. } = leaves.clone();
    let colors = sh_colors(means, sh, viewmat, place.tensor(rows, [COUNT, PROJECTED]).autodiff(), degree);
    let weights = Random::new(10).values(COUNT * 3, -1.0, 1.0);
    (colors * place.tensor(&weights, [COUNT, 3]).autodiff()).sum()
}

fn gradients(scene: &Scene, rows: &[f64], degree: usize, place: &Place, sh_colors: ShColors) -> [Vec<f64>; 7] {
    let leaves = scene.leaves(place);
    leaves.gradients(&sum(&leaves, rows, degree, place, sh_colors).backward())
}

#[test]
fn doubles_are_the_central_differences() {
    let scene = Scene::random(COUNT, 5);
    let rows = scene.reference_rows();
    for place in doubles() {
        for degree in 0..=3 {
            let gradients = gradients(&scene, &rows, degree, place, sh_colors);
            for k in depends_on(degree).iter().copied() {
                let what = format!("{} at degree {degree} on {}", GROUPS[k], place.name);
                // The last row of a viewmat is no parameter.
                let used = if k == VIEWMAT { 12 } else { scene.groups()[k].len() };
                assert_derivative(&what, &scene.groups()[k][..used], &gradients[k][..used], 200, |x| {
                    let mut moved = scene.clone();
                    moved.groups_mut()[k][..used].copy_from_slice(x);
                    values(&sum(&moved.leaves(place), &rows, degree, place, sh_colors))[0]
                });
            }
        }
    }
}

#[test]
fn every_device_follows_the_reference() {
    let scene = Scene::random(COUNT, 6);
    let rows = scene.reference_rows();
    for degree in 0..=3 {
        let expected = gradients(&scene, &rows, degree, reference(), sh_colors_reference);
        for (place, bound) in
            doubles().iter().map(|p| (p, GRADIENT_F64)).chain(singles().iter().map(|p| (p, GRADIENT_F32)))
        {
            let actual = gradients(&scene, &rows, degree, place, sh_colors);
            for k in depends_on(degree).iter().copied() {
                let what = format!("{} at degree {degree} on {}", GROUPS[k], place.name);
                assert_gradient(&what, &actual[k], &expected[k], bound);
            }
        }
    }
}
