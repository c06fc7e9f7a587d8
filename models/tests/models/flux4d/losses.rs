//! The terms of the loss against numbers worked out by hand and against the fused operation.

use burn::tensor::Tensor;
use gs_base::Intrinsics;
use gs_burn::glam::{DMat4, DVec3};
use gs_burn::ops::intersect::DeviceCount;
use gs_burn::ops::ssim::{l1_ssim_reference, photometric_loss};
use gs_burn::{Camera, Rendering};
use gs_models::flux4d::losses::{depth_loss, image_velocity, mean_speed, photometric, velocity_weights};
use gs_models::flux4d::similarity::ssim_map;
use gs_tests::devices::{Place, everywhere, reference};
use gs_tests::scenes::Random;
use gs_tests::tolerance::{FORWARD_F32, FORWARD_F64, GRADIENT_F64, assert_gradient, assert_near, values};

fn images(place: &Place, [height, width]: [usize; 2]) -> (Vec<f64>, Tensor<3>) {
    let mut random = Random::new(4);
    let image = random.values(height * width * 3, 0.0, 1.0);
    (image, place.tensor(&random.values(height * width * 3, 0.0, 1.0), [height, width, 3]))
}

/// Sizes below a window, at a band's edge, and beyond it.
#[test]
fn similarity_by_pixel_has_the_mean_of_the_fused_one() {
    for place in everywhere() {
        for size in [[3, 7], [13, 64], [70, 131]] {
            let (image, photo) = images(place, size);
            let image = place.tensor(&image, [size[0], size[1], 3]);
            let expected = values(&l1_ssim_reference(image.clone(), photo.clone()))[1];
            let bound = if place.is_double() { FORWARD_F64 } else { FORWARD_F32 };
            assert_near(
                &format!("{} {size:?}", place.name),
                &values(&ssim_map(image, photo).mean()),
                &[expected],
                bound,
            );
        }
    }
}

#[test]
fn weights_of_one_are_no_weights() {
    let place = reference();
    let size = [20, 70];
    let (image, photo) = images(place, size);
    let ones = Tensor::ones([20, 70, 1], (&place.device, place.dtype));
    let with = |loss: &dyn Fn(Tensor<3>) -> Tensor<1>| {
        let leaf = place.leaf(&image, [20, 70, 3]);
        let loss = loss(leaf.clone());
        let gradient = leaf.grad(&loss.backward()).expect("a gradient");
        (values(&loss)[0], values(&gradient))
    };
    let (fused, fused_gradient) = with(&|image| photometric_loss(image, photo.clone(), 0.2));
    let (weighted, gradient) = with(&|image| photometric(image, photo.clone(), Some(ones.clone()), 0.2));
    assert_near("loss", &[weighted], &[fused], FORWARD_F64);
    assert_gradient("image", &gradient, &fused_gradient, GRADIENT_F64);
    let (doubled, _) = with(&|image| photometric(image, photo.clone(), Some(ones.clone() * 2.0), 0.2));
    assert_near("twice the weight", &[doubled], &[2.0 * fused], FORWARD_F64);
}

#[test]
fn the_weight_is_one_plus_the_clipped_speed_without_gradient() {
    for place in everywhere() {
        let speed = place.leaf(&[3.0, 4.0, 0.0, 0.0, 300.0, -400.0], [1, 3, 2]);
        let weights = velocity_weights(speed, 10.0);
        assert!(!weights.is_autodiff());
        assert_near(&place.name, &values(&weights), &[6.0, 1.0, 11.0], 1e-6);
    }
}

#[test]
fn depth_counts_where_there_is_lidar_and_a_surface() {
    let place = reference();
    let image = |values: [f64; 4]| place.tensor(&values, [2, 2, 1]);
    let rendering = Rendering {
        color: place.tensor(&[0.0; 12], [2, 2, 3]),
        alpha: image([0.5, 1.0, 0.01, 1.0]),
        depth: Some(image([2.0, 7.0, 1.0, 3.0])),
        features: None,
        projected: place.tensor(&[], [0, 8]),
        intersections: DeviceCount::Known(0),
    };
    // Depths 4, 7, -, 3 against 5, -, 9, 1.
    let loss = depth_loss(&rendering, image([5.0, 0.0, 9.0, 1.0]));
    assert_near("depth", &values(&loss), &[0.5 * (1.0 + 2.0)], 1e-12);
    assert_eq!(values(&depth_loss(&rendering, image([0.0; 4]))), [0.0]);
}

#[test]
fn speed_is_a_mean_of_norms_and_smooth_at_rest() {
    let place = reference();
    let velocity = place.leaf(&[3.0, 4.0, 0.0, 0.0, 0.0, 0.0, 9.0, 9.0, 9.0], [3, 3]);
    let speed = mean_speed(velocity.clone(), 2);
    // The floor lowers a norm by at most 1e-3 m.
    assert_near("speed", &values(&speed), &[2.5], 1e-3);
    let gradient = values(&velocity.grad(&speed.backward()).expect("a gradient"));
    assert_near("gradient", &gradient, &[0.3, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1e-6);
}

#[test]
fn image_velocity_is_the_motion_of_the_projection() {
    let place = reference();
    let pose = DMat4::from_rotation_y(0.3) * DMat4::from_rotation_x(-0.2);
    let pose = DMat4::from_translation(DVec3::new(1.0, -0.5, 0.2)) * pose;
    let intrinsics = Intrinsics { fx: 300.0, fy: 250.0, cx: 40.0, cy: 30.0 };
    let camera = Camera::from_c2w(pose, intrinsics, 80, 60, &place.device);
    let (mean, velocity) = (DVec3::new(4.0, 1.0, 12.0), DVec3::new(-3.0, 2.0, 5.0));
    let pixel = |p: DVec3| {
        let p = pose.inverse().transform_point3(p);
        [300.0 * p.x / p.z, 250.0 * p.y / p.z]
    };
    let h = 1e-5;
    let (up, down) = (pixel(mean + velocity * h), pixel(mean - velocity * h));
    let expected = [0, 1].map(|i| 0.1 * (up[i] - down[i]) / (2.0 * h));
    let rows = |v: DVec3| place.tensor(&[v.x, v.y, v.z, -v.x, -v.y, -v.z], [2, 3]);
    let found = values(&image_velocity(rows(mean), rows(velocity), &camera, 0.1));
    // The camera's pose is held in `f32`: 1e-7 of velocities of 10 pixels, times the slope of the projection.
    assert_near("in view", &found[..2], &expected, 1e-4);
    assert_eq!(found[2..], [0.0; 2], "behind the camera");
}
