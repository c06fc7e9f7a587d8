use super::*;
use crate::ops::projection::project;
use crate::testing::{Scene, assert_same_gradients, gradient_of, tensor, values};

fn rows(scene: &Scene) -> Tensor<2> {
    let Scene { means, quats, log_scales, viewmat, config, .. } = scene.clone();
    project(means, quats, log_scales, viewmat, &config)
}

fn assert_twins(scene: &Scene, projected: &Tensor<2>, degree: usize) {
    let [actual, expected] = [sh_colors, sh_colors_reference].map(|colors| {
        let Scene { means, sh, viewmat, .. } = scene.clone();
        colors(means, sh, viewmat, projected.clone(), degree)
    });
    let (sh, means, viewmat) = (gradient_of(&scene.sh), gradient_of(&scene.means), gradient_of(&scene.viewmat));
    if degree == 0 {
        assert_same_gradients(actual, expected, &[("sh", &sh)]);
    } else {
        assert_same_gradients(actual, expected, &[("sh", &sh), ("means", &means), ("viewmat", &viewmat)]);
    }
}

#[test]
fn kernel_is_the_reference_at_every_degree() {
    for stored in 0..=3 {
        for active in 0..=stored {
            let scene = Scene::random(20, stored, 5);
            assert_twins(&scene, &rows(&scene), active);
        }
    }
}

/// The coefficients of degree 3 in two leaves.
fn bands(sh: &Tensor<3>) -> [Tensor<3>; 2] {
    [(0, 9), (9, 7)].map(|(first, count)| sh.clone().inner().narrow(1, first, count).autodiff().require_grad())
}

/// Colours and gradients with the third band apart are those of the reference.
fn assert_bands_are_twins(scene: &Scene, projected: &Tensor<2>) {
    let [sh, third] = bands(&scene.sh);
    let [actual, expected] = [sh_colors_of_bands, sh_colors_of_bands_reference].map(|colors| {
        let Scene { means, viewmat, .. } = scene.clone();
        colors(means, sh.clone(), third.clone(), viewmat, projected.clone())
    });
    let (of_sh, of_third) = (gradient_of(&sh), gradient_of(&third));
    let (means, viewmat) = (gradient_of(&scene.means), gradient_of(&scene.viewmat));
    assert_same_gradients(
        actual,
        expected,
        &[("sh", &of_sh), ("third", &of_third), ("means", &means), ("viewmat", &viewmat)],
    );
}

#[test]
fn a_third_band_apart_is_the_reference() {
    let scene = Scene::random(20, 3, 7);
    assert_bands_are_twins(&scene, &rows(&scene));
}

#[test]
fn a_third_band_without_rows_has_no_colours() {
    let scene = Scene::random(0, 3, 7);
    let [sh, third] = bands(&scene.sh);
    let colors = sh_colors_of_bands(scene.means.clone(), sh, third.clone(), scene.viewmat.clone(), rows(&scene));
    assert_eq!(colors.dims(), [0, 3]);
    let gradients = colors.sum().backward();
    assert_eq!(third.grad(&gradients).expect("a gradient").dims(), [0, 7, 3]);
}

#[test]
fn a_third_band_apart_hides_what_is_not_drawn() {
    for coefficient in [5, 40] {
        let mut scene = Scene::random(4, 3, 6);
        let mut sh = values(&scene.sh);
        sh[48 + coefficient] = f64::NAN;
        scene.sh = tensor(sh, [4, 16, 3]).require_grad();
        let seen = values(&rows(&scene)).iter().enumerate().map(|(i, x)| if i < 8 { 0.0 } else { *x }).collect();
        let projected = tensor(seen, [4, 8]);
        assert_bands_are_twins(&scene, &projected);
        let [sh, third] = bands(&scene.sh);
        let colors = values(&sh_colors_of_bands(scene.means, sh, third, scene.viewmat, projected));
        assert_eq!(colors[..3], [0.0; 3]);
        assert_eq!(colors[3..6], [gs_kernels::constants::INVALID_FEATURE; 3]);
    }
}

#[test]
fn what_is_not_drawn_has_no_colour_and_no_gradient() {
    let mut scene = Scene::random(4, 3, 6);
    let mut sh = values(&scene.sh);
    sh[48 + 5] = f64::NAN;
    scene.sh = tensor(sh, [4, 16, 3]).require_grad();
    let projected =
        tensor(values(&rows(&scene)).iter().enumerate().map(|(i, x)| if i < 8 { 0.0 } else { *x }).collect(), [4, 8]);
    assert_twins(&scene, &projected, 3);
    let colors = values(&sh_colors(scene.means, scene.sh, scene.viewmat, projected, 3));
    assert_eq!(colors[..3], [0.0; 3]);
    assert_eq!(colors[3..6], [gs_kernels::constants::INVALID_FEATURE; 3]);
}
