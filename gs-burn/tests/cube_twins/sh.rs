//! Spherical harmonics, forward and backward.

use gs_kernels::config::ShConfig;
use gs_kernels::constants::INVALID_FEATURE;
use gs_kernels::cpu;
use gs_kernels::cube::sh;

use super::support::{Random, Scene, assert_gradient, assert_values, client, down, up, wide};

fn check(degree: u32, coefficients: usize) {
    let scene = Scene::random(20 + u64::from(degree), 300, 64, 48);
    let config = ShConfig { degree, coefficients };
    let projected = scene.projected();
    let mut random = Random(30);
    let values = random.list(scene.count * coefficients * 3, -0.6, 0.6);
    let (means, viewmat) = (wide(&scene.means), wide(&scene.viewmat));
    let want = cpu::sh::forward(&means, &wide(&values), &viewmat, &wide(&projected), &config);
    let buffers = [up(&scene.means), up(&values), up(&scene.viewmat), up(&projected)];
    let [b_means, b_sh, b_viewmat, b_projected] = &buffers;
    let got = down(&sh::forward(client(), b_means, b_sh, b_viewmat, b_projected, &config).expect("forward"));
    assert_values("colours", &got, &want, 1e-5);

    let v = random.list(got.len(), -1.0, 1.0);
    let want = cpu::sh::backward(&means, &wide(&values), &viewmat, &wide(&projected), &config, &wide(&v));
    let got = sh::backward(client(), b_means, b_sh, b_viewmat, b_projected, &config, &up(&v), true).expect("backward");
    assert_gradient("sh", &down(&got.sh), &want.sh, 1e-3);
    if degree > 0 {
        assert_gradient("means", &down(&got.means), &want.means, 1e-3);
        assert_gradient("viewmat", &down(got.viewmat.as_ref().expect("wanted")), &want.viewmat, 1e-3);
    }
}

#[test]
fn every_degree() {
    check(0, 1);
    check(1, 4);
    check(2, 9);
    check(3, 16);
}

#[test]
fn active_degree_below_the_stored_one() {
    check(1, 16);
    check(0, 9);
}

#[test]
fn bad_coefficients_and_gradients() {
    let scene = Scene::random(26, 40, 64, 48);
    let config = ShConfig { degree: 1, coefficients: 4 };
    let projected = scene.projected();
    let first = (0..40).find(|i| projected[8 * i + 7] > 0.0).expect("someone is seen");
    let mut values = vec![0.1; 40 * 12];
    values[12 * first + 2] = f32::NAN;
    let buffers = [up(&scene.means), up(&values), up(&scene.viewmat), up(&projected)];
    let [means, coefficients, viewmat, projected] = &buffers;
    let colours = down(&sh::forward(client(), means, coefficients, viewmat, projected, &config).expect("forward"));
    assert_eq!(colours[3 * first..3 * first + 3], [INVALID_FEATURE as f32; 3]);
    assert!(colours.iter().all(|v| v.is_finite()));
    let mut v = vec![1.0; 120];
    v[7] = f32::INFINITY;
    let got =
        sh::backward(client(), means, coefficients, viewmat, projected, &config, &up(&v), true).expect("backward");
    for gradient in [down(&got.sh), down(&got.means), down(got.viewmat.as_ref().expect("wanted"))] {
        assert!(gradient.iter().all(|v| v.is_finite()));
        assert!(gradient.iter().any(|&v| v != 0.0));
    }
    assert_eq!(down(&got.sh)[12 * first..12 * first + 12], [0.0; 12]);
}
