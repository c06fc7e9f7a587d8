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
