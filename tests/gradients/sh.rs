//! `gs_burn::ops::sh`.

use burn::tensor::Tensor;
use gs_burn::ops::sh::{sh_colors, sh_colors_reference};
use gs_kernels::rows::PROJECTED;
use gs_tests::devices::{Place, bounded, doubles, reference};
use gs_tests::finite_differences::Course;
use gs_tests::scenes::{COLUMNS, Leaves, Random, Scene, assert_gradients};
use gs_tests::tolerance::{GRADIENT_F32, GRADIENT_F64};

const COUNT: usize = 30;
const MEANS: usize = 0;
const SH: usize = 4;
const VIEWMAT: usize = 5;

type ShColors = fn(Tensor<2>, Tensor<3>, Tensor<2>, Tensor<2>, usize) -> Tensor<2>;

/// The groups that colours of a degree depend on: the plain colour has no direction.
fn depends_on(degree: usize) -> &'static [usize] {
    if degree == 0 { &[SH] } else { &[MEANS, SH, VIEWMAT] }
}

/// A weighted sum of the colours of a degree by the first `stored` coefficients.
fn sum(leaves: &Leaves, rows: &[f64], [degree, stored]: [usize; 2], place: &Place, sh_colors: ShColors) -> Tensor<1> {
    let Leaves { means, sh, viewmat, .. } = leaves.clone();
    let rows = place.tensor(rows, [COUNT, PROJECTED]).autodiff();
    let colors = sh_colors(means, sh.narrow(1, 0, stored), viewmat, rows, degree);
    let weights = Random::new(10).values(COUNT * 3, -1.0, 1.0);
    (colors * place.tensor(&weights, [COUNT, 3]).autodiff()).sum()
}

#[test]
fn doubles_are_the_central_differences() {
    let scene = Scene::random(COUNT, 5);
    let rows = scene.reference_rows();
    for place in doubles() {
        for degree in 0..=3 {
            let sum = |leaves: &Leaves| sum(leaves, &rows, [degree, 16], place, sh_colors);
            let what = format!("degree {degree}");
            scene.assert_derivatives(&what, Course::Smooth, place, depends_on(degree), 200, sum);
        }
    }
}

#[test]
fn every_device_follows_the_reference() {
    let scene = Scene::random(COUNT, 6);
    let rows = scene.reference_rows();
    for [degree, stored] in [1, 4, 9, 16].into_iter().enumerate().flat_map(|(most, n)| (0..=most).map(move |d| [d, n]))
    {
        let gradients = |place: &Place, sh_colors: ShColors| {
            let leaves = scene.leaves(place);
            leaves.gradients(&sum(&leaves, &rows, [degree, stored], place, sh_colors).backward())
        };
        let expected = gradients(reference(), sh_colors_reference);
        for (place, bound) in bounded(GRADIENT_F64, GRADIENT_F32) {
            let what = format!("degree {degree} of {stored} coefficients on {}", place.name);
            assert_gradients(&what, depends_on(degree), &gradients(place, sh_colors), &expected, bound);
        }
    }
}

/// A culled Gaussian, and one with a coefficient that is no number, get exactly zero.
#[test]
fn what_is_not_drawn_gets_nothing() {
    let mut scene = Scene::random(COUNT, 6);
    let mut rows = scene.reference_rows();
    rows[..PROJECTED].fill(0.0);
    scene.sh[COLUMNS[SH] + 5] = f64::NAN;
    let gradients = |place: &Place, sh_colors: ShColors| {
        let leaves = scene.leaves(place);
        leaves.gradients(&sum(&leaves, &rows, [3, 16], place, sh_colors).backward())
    };
    let expected = gradients(reference(), sh_colors_reference);
    for (place, bound) in bounded(GRADIENT_F64, GRADIENT_F32) {
        let actual = gradients(place, sh_colors);
        assert_gradients(&format!("on {}", place.name), depends_on(3), &actual, &expected, bound);
        for k in [MEANS, SH] {
            assert!(actual[k][..2 * COLUMNS[k]].iter().all(|g| *g == 0.0), "group {k} on {}", place.name);
        }
    }
}
