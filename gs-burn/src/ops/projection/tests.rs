use super::*;
use crate::testing::{Scene, assert_same_gradients, gradient_of, tensor, values};

fn both(scene: &Scene) -> [Tensor<2>; 2] {
    [project, project_reference].map(|project| {
        let Scene { means, quats, log_scales, viewmat, config, .. } = scene.clone();
        project(means, quats, log_scales, viewmat, &config)
    })
}

fn assert_twins(scene: &Scene) {
    let [actual, expected] = both(scene);
    assert_same_gradients(
        actual,
        expected,
        &[
            ("means", &gradient_of(&scene.means)),
            ("quats", &gradient_of(&scene.quats)),
            ("log_scales", &gradient_of(&scene.log_scales)),
            ("viewmat", &gradient_of(&scene.viewmat)),
        ],
    );
}

#[test]
fn kernel_is_the_reference() {
    assert_twins(&Scene::random(40, 0, 1));
}

#[test]
fn kernel_is_the_reference_beyond_the_frustum_limits() {
    let mut scene = Scene::random(3, 0, 2);
    // Large Gaussians whose centres lie outside the image at either side and above.
    scene.means = tensor(vec![3.5, 0.0, 2.0, -3.5, 0.1, 2.0, 0.0, -3.0, 2.0], [3, 3]).require_grad();
    scene.log_scales = tensor(vec![0.5, 0.2, 0.3, 0.6, 0.2, 0.4, 0.2, 0.7, 0.1], [3, 3]).require_grad();
    let [rows, _] = both(&scene);
    assert!(values(&rows).iter().skip(7).step_by(8).all(|&radius| radius > 0.0), "none is culled");
    assert_twins(&scene);
}

#[test]
fn both_cull_the_same() {
    let mut scene = Scene::random(9, 0, 3);
    let mut means = values(&scene.means);
    let mut quats = values(&scene.quats);
    let mut log_scales = values(&scene.log_scales);
    means[2] = -1.0;
    means[3 + 2] = -0.3;
    means[2 * 3] = f64::NAN;
    means[3 * 3] = 100.0;
    quats[4 * 4..5 * 4].fill(0.0);
    quats[5 * 4] = f64::INFINITY;
    log_scales[6 * 3..7 * 3].fill(300.0);
    log_scales[7 * 3] = f64::NAN;
    scene.means = tensor(means, [9, 3]).require_grad();
    scene.quats = tensor(quats, [9, 4]).require_grad();
    scene.log_scales = tensor(log_scales, [9, 3]).require_grad();
    let [rows, _] = both(&scene);
    assert!(values(&rows)[..8 * 8].iter().all(|&x| x == 0.0));
    assert!(values(&rows)[8 * 8..].iter().any(|&x| x != 0.0));
    assert_twins(&scene);
}

#[test]
#[should_panic(expected = "axis 1 expected 4, got 3")]
fn a_wrong_shape_is_named() {
    let Scene { means, log_scales, viewmat, config, .. } = Scene::random(2, 0, 4);
    project(means, log_scales.clone(), log_scales, viewmat, &config);
}
