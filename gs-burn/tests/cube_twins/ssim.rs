//! L1 and SSIM, forward and backward.

use gs_kernels::cpu;
use gs_kernels::cube::ssim;

use super::support::{Random, assert_gradient, assert_values, client, down, up, wide};

fn check(width: usize, height: usize, channels: usize) {
    let mut random = Random(40);
    let image = random.list(width * height * channels, 0.0, 1.0);
    // Close enough to be similar, far enough that no difference is zero.
    let target: Vec<f32> = image.iter().map(|v| v + random.within(0.01, 0.3)).collect();
    let (wide_image, wide_target) = (wide(&image), wide(&target));
    let mut want = cpu::ssim::forward(&wide_image, &wide_target, width, height, channels, true);
    let (b_image, b_target) = (up(&image), up(&target));
    let got = ssim::forward(client(), &b_image, &b_target, width, height, channels).expect("forward");
    assert_values("means", &down(&got.means), &[want.l1, want.ssim], 1e-5);
    // So a photo fits wherever its image does.
    assert!(got.saved.iter().all(|map| map.len() <= image.len()), "a buffer larger than the image");

    let v = [0.8, -0.7];
    let v_means = v.map(|v| v as f32);
    let (v_l1, v_ssim) = (f64::from(v_means[0]), f64::from(v_means[1]));
    cpu::ssim::backward(&wide_image, &wide_target, &mut want.gradient, v_l1, v_ssim);
    let got = ssim::backward(client(), &b_image, &b_target, &got.saved, width, height, channels, &up(&v_means))
        .expect("backward");
    assert_gradient("image", &down(&got), &want.gradient, 1e-3);
}

#[test]
fn any_size() {
    check(33, 20, 3);
    check(16, 16, 1);
    check(5, 47, 2);
    check(1, 1, 3);
}

#[test]
fn bad_pixels_count_as_zero() {
    let mut image = vec![0.5; 20 * 20];
    image[50] = f32::NAN;
    image[51] = 1e20;
    let target = vec![0.25; 20 * 20];
    let (image, target) = (up(&image), up(&target));
    let got = ssim::forward(client(), &image, &target, 20, 20, 1).expect("forward");
    assert!(down(&got.means).iter().all(|v| v.is_finite()));
    let v = ssim::backward(client(), &image, &target, &got.saved, 20, 20, 1, &up(&[1.0, f32::NAN])).expect("backward");
    let v = down(&v);
    assert!(v.iter().all(|v| v.is_finite()));
    assert_eq!((v[50], v[51]), (0.0, 0.0));
    assert!(v[0] > 0.0);
}

#[test]
fn no_pixels() {
    let empty = up(&[]);
    let got = ssim::forward(client(), &empty, &empty, 0, 7, 3).expect("forward");
    assert_eq!(down(&got.means), [0.0, 1.0]);
}
