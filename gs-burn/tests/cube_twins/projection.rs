//! The projection, forward and backward.

use gs_kernels::cpu;
use gs_kernels::cube::projection::{self, ProjectionGradients};
use gs_kernels::rows::PROJECTED;

use super::support::{Random, Scene, assert_gradient, assert_values, client, down, up, wide};

fn forward(scene: &Scene) -> Vec<f32> {
    let (means, quats, log_scales) = (up(&scene.means), up(&scene.quats), up(&scene.log_scales));
    let viewmat = up(&scene.viewmat);
    down(&projection::forward(client(), &means, &quats, &log_scales, &viewmat, &scene.camera).expect("forward"))
}

fn backward(scene: &Scene, projected: &[f32], v_projected: &[f32]) -> ProjectionGradients {
    let (means, quats, log_scales) = (up(&scene.means), up(&scene.quats), up(&scene.log_scales));
    let (viewmat, projected, v_projected) = (up(&scene.viewmat), up(projected), up(v_projected));
    projection::backward(client(), &means, &quats, &log_scales, &viewmat, &scene.camera, &projected, &v_projected, true)
        .expect("backward")
}

/// Rows within `tolerance` and gradients within `gradient_tolerance` of the CPU in `f64`.
fn check(scene: &Scene, seed: u64, tolerance: f64, gradient_tolerance: f64) {
    let (means, quats, log_scales) = (wide(&scene.means), wide(&scene.quats), wide(&scene.log_scales));
    let viewmat = wide(&scene.viewmat);
    let want = cpu::projection::forward(&means, &quats, &log_scales, &viewmat, &scene.camera);
    let got = forward(scene);
    let seen = |rows: &[f64]| rows.chunks(PROJECTED).filter(|row| row[7] > 0.0).count();
    println!("{} of {} seen", seen(&want), scene.count);
    assert_values("projected", &got, &want, tolerance);

    let v: Vec<f32> = Random(seed).list(got.len(), -1.0, 1.0);
    let want = cpu::projection::backward(&means, &quats, &log_scales, &viewmat, &scene.camera, &want, &wide(&v));
    let got = backward(scene, &got, &v);
    assert_gradient("means", &down(&got.means), &want.means, gradient_tolerance);
    assert_gradient("quats", &down(&got.quats), &want.quats, gradient_tolerance);
    assert_gradient("log_scales", &down(&got.log_scales), &want.log_scales, gradient_tolerance);
    assert_gradient("viewmat", &down(got.viewmat.as_ref().expect("wanted")), &want.viewmat, gradient_tolerance);
}

#[test]
fn random_scene() {
    // More than one cube, and not a multiple of one.
    check(&Scene::random(1, 600, 70, 45), 11, 1e-5, 1e-3);
}

#[test]
fn antialiased() {
    let mut scene = Scene::random(2, 300, 64, 64);
    scene.camera.antialiased = true;
    check(&scene, 12, 1e-5, 1e-3);
}

#[test]
fn across_the_frustum_edge() {
    let mut scene = Scene::random(3, 200, 64, 48);
    for mean in scene.means.chunks_mut(3) {
        mean[0] *= 2.0;
    }
    scene.log_scales.iter_mut().for_each(|s| *s += 1.0);
    check(&scene, 13, 3e-4, 1e-2);
}

#[test]
fn across_the_near_plane() {
    let mut scene = Scene::random(8, 200, 64, 48);
    // Depths from just behind the camera to a tenth of a unit before it.
    for (index, mean) in scene.means.chunks_mut(3).enumerate() {
        let shrink = 0.02 * (index % 7) as f32 / mean[2];
        mean.iter_mut().for_each(|v| *v *= shrink);
    }
    scene.viewmat = [0.0; 16];
    (0..4).for_each(|k| scene.viewmat[5 * k] = 1.0);
    scene.log_scales.iter_mut().for_each(|s| *s -= 3.0);
    check(&scene, 14, 3e-4, 1e-2);
}

#[test]
fn needles() {
    let mut scene = Scene::random(9, 200, 64, 48);
    for scales in scene.log_scales.chunks_mut(3) {
        scales.copy_from_slice(&[0.3, -7.0, -7.0]);
    }
    check(&scene, 15, 3e-4, 1e-2);
}

#[test]
fn bad_gaussians_leave_the_others_alone() {
    let clean = Scene::random(4, 300, 64, 48);
    let mut scene = Scene::random(4, 300, 64, 48);
    let bad = [0.0, f32::NAN, f32::INFINITY, -f32::INFINITY, 1e-30, 1e30, -1e30, 3e38, -90.0, 90.0];
    let mut random = Random(5);
    let mut spoilt = Vec::new();
    for index in (0..300).step_by(3) {
        let value = bad[random.bits() as usize % bad.len()];
        match random.bits() % 5 {
            0 => scene.means[3 * index + random.bits() as usize % 3] = value,
            1 => scene.quats[4 * index + random.bits() as usize % 4] = value,
            2 => scene.log_scales[3 * index + random.bits() as usize % 3] = value,
            3 => scene.quats[4 * index..4 * index + 4].fill(0.0),
            _ => scene.log_scales[3 * index..3 * index + 3].fill(value),
        }
        spoilt.push(index);
    }
    let (rows, clean_rows) = (forward(&scene), forward(&clean));
    assert!(rows.iter().all(|v| v.is_finite()));
    let v: Vec<f32> = random.list(rows.len(), -1.0, 1.0);
    let gradients = backward(&scene, &rows, &v);
    let clean_gradients = backward(&clean, &clean_rows, &v);
    let pairs = [
        (rows, clean_rows, PROJECTED),
        (down(&gradients.means), down(&clean_gradients.means), 3),
        (down(&gradients.quats), down(&clean_gradients.quats), 4),
        (down(&gradients.log_scales), down(&clean_gradients.log_scales), 3),
    ];
    for (got, clean, width) in pairs {
        assert!(got.iter().all(|v| v.is_finite()));
        for index in (0..300).filter(|index| !spoilt.contains(index)) {
            let range = index * width..(index + 1) * width;
            assert_eq!(got[range.clone()], clean[range], "Gaussian {index} noticed a bad one");
        }
    }
    assert!(down(gradients.viewmat.as_ref().expect("wanted")).iter().all(|v| v.is_finite()));
}

#[test]
fn not_finite_gradients_become_zero() {
    let scene = Scene::random(6, 10, 64, 48);
    let rows = forward(&scene);
    let mut v = vec![1.0; rows.len()];
    v[0] = f32::NAN;
    v[PROJECTED + 2] = f32::INFINITY;
    let gradients = backward(&scene, &rows, &v);
    let means = down(&gradients.means);
    assert!(means[..6].iter().all(|&v| v == 0.0));
    assert!(means[6..].iter().any(|&v| v != 0.0));
    assert!(down(gradients.viewmat.as_ref().expect("wanted")).iter().all(|v| v.is_finite()));
}

#[test]
fn no_gaussians() {
    let scene = Scene::random(7, 0, 64, 48);
    assert!(forward(&scene).is_empty());
    let gradients = backward(&scene, &[], &[]);
    assert!(down(&gradients.means).is_empty());
    assert_eq!(down(gradients.viewmat.as_ref().expect("wanted")), [0.0; 16]);
}
