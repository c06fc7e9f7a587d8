//! Eq. 6 and 8 to 10: against projecting moved points one by one, and by differences.

use burn::tensor::Tensor;
use gs_base::Intrinsics;
use gs_burn::glam::{DMat3, DQuat, DVec3};
use gs_models::Pixels;
use gs_models::taylormode::blur_path::{NEAREST, back_project, blur_path, camera_velocity, hybrid_depth, to_world};
use gs_tests::devices::{Place, doubles, everywhere, reference};
use gs_tests::finite_differences::assert_derivatives;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_finite, assert_near, values};

const CAMERA: Intrinsics = Intrinsics { fx: 40.0, fy: 44.0, cx: 3.2, cy: 2.4 };

fn pose(place: &Place) -> (DMat3, DVec3, Tensor<2>) {
    let rotation = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(0.3, -0.7, 0.2)));
    let translation = DVec3::new(0.4, -0.2, 1.5);
    let r = rotation.transpose().to_cols_array_2d();
    let t = translation.to_array();
    let rows: Vec<f64> = (0..3).flat_map(|i| [r[i][0], r[i][1], r[i][2], t[i]]).chain([0.0, 0.0, 0.0, 1.0]).collect();
    (rotation, translation, place.tensor(&rows, [4, 4]))
}

#[test]
fn paths_are_projections_of_moved_points() {
    for place in doubles() {
        let mut random = Random::new(1);
        let (rotation, translation, viewmat) = pose(place);
        let mask = [0, 1, 1, 0, 0, 255, 0, 1, 0, 0, 0, 1];
        let pixels = Pixels::masked(&mask, 4, 3, &place.device).expect("pixels are set");
        let depth = random.values(5, 2.0, 4.0);
        let velocity = random.values(15, -1.0, 1.0);
        let offsets = [-0.3, 0.0, 0.1];
        let depths = place.tensor(&depth, [5, 1]);
        let v_cam = camera_velocity(place.tensor(&velocity, [5, 3]), &viewmat);
        let path = blur_path(&pixels, depths.clone(), v_cam, &CAMERA, place.tensor(&offsets, [3]));
        let points = to_world(back_project(&pixels, depths, &CAMERA), &viewmat);

        let centres = [[1.5, 0.5], [2.5, 0.5], [1.5, 1.5], [3.5, 1.5], [3.5, 2.5]];
        let world: Vec<DVec3> = centres
            .iter()
            .zip(&depth)
            .map(|([x, y], z)| {
                let cam = DVec3::new((x - CAMERA.cx) / CAMERA.fx * z, (y - CAMERA.cy) / CAMERA.fy * z, *z);
                rotation.transpose() * (cam - translation)
            })
            .collect();
        let expected: Vec<f64> = world.iter().flat_map(|p| p.to_array()).collect();
        assert_near(&format!("{}: points", place.name), &values(&points), &expected, 1e-12);
        let expected = offsets.iter().flat_map(|t| {
            world.iter().zip(velocity.chunks(3)).flat_map(move |(p, v)| {
                let cam = rotation * (*p + DVec3::from_slice(v) * *t) + translation;
                [CAMERA.fx * cam.x / cam.z + CAMERA.cx, CAMERA.fy * cam.y / cam.z + CAMERA.cy]
            })
        });
        let expected: Vec<f64> = expected.collect();
        assert_near(&format!("{}: path", place.name), &values(&path), &expected, 1e-11);
    }
}

#[test]
fn what_does_not_move_stays_to_the_bit() {
    for place in everywhere() {
        let pixels = Pixels::all(4, 3, &place.device);
        let depth = place.tensor(&Random::new(2).values(12, 0.5, 4.0), [12, 1]);
        let offsets = place.tensor(&[-0.5, 0.5], [2]);
        let path = blur_path(&pixels, depth, place.tensor(&[0.0; 36], [12, 3]), &CAMERA, offsets);
        let centres = values(&pixels.centres);
        assert_eq!(values(&path), [centres.clone(), centres].concat(), "{}", place.name);
    }
}

#[test]
fn unknown_depth_and_points_that_reach_the_camera_stay_finite() {
    for place in everywhere() {
        let pixels = Pixels::all(2, 1, &place.device);
        let depth = place.leaf(&[0.0, 0.5], [2, 1]);
        let velocity = place.leaf(&[1.0, 1.0, 1.0, 0.1, 0.1, -2.0], [2, 3]);
        let offsets = place.leaf(&[0.25, 1.0], [2]);
        let path = blur_path(&pixels, depth.clone(), velocity.clone(), &CAMERA, offsets.clone());
        let numbers = values(&path);
        assert_finite(&place.name, &numbers);
        assert_eq!(numbers[..2], [0.5, 0.5], "{}: a pixel that shows nothing moved", place.name);
        let gradients = path.sum().backward();
        assert_finite(&place.name, &values(&depth.grad(&gradients).expect("tracked")));
        assert_finite(&place.name, &values(&velocity.grad(&gradients).expect("tracked")));
        assert_finite(&place.name, &values(&offsets.grad(&gradients).expect("tracked")));
    }
}

#[test]
fn gradients_are_derivatives() {
    let place = reference();
    let mut random = Random::new(3);
    let pixels = Pixels::all(3, 2, &place.device);
    let (depth, velocity) = (random.values(6, 2.0, 4.0), random.values(18, -1.0, 1.0));
    let pull = place.tensor(&random.values(36, -1.0, 1.0), [3, 6, 2]);
    let arguments: [(&str, &[f64]); 3] = [("depth", &depth), ("velocity", &velocity), ("offsets", &[-0.2, 0.05, 0.3])];
    assert_derivatives("path", place, arguments, 18, |[depth, velocity, offsets]| {
        (blur_path(&pixels, depth.reshape([6, 1]), velocity.reshape([6, 3]), &CAMERA, offsets) * pull.clone()).sum()
    });
}

#[test]
fn depths_mix_where_both_are_known() {
    for place in everywhere() {
        let rendered = place.tensor(&[2.0, 2.0, 0.0, 0.0], [4, 1]);
        let prior = place.tensor(&[3.0, 0.0, 5.0, 0.0], [4, 1]);
        let mixed = values(&hybrid_depth(rendered, prior, 0.3));
        assert_near(&place.name, &mixed, &[2.3, 2.0, 5.0, 0.0], 1e-6);
        assert!(mixed[3] < NEAREST);
    }
}

#[test]
fn rows_of_pixels_come_from_and_go_back_to_images() {
    for place in everywhere() {
        let image = place.tensor(&(0..18).map(f64::from).collect::<Vec<_>>(), [2, 3, 3]);
        let pixels = Pixels::masked(&[0, 0, 1, 1, 0, 0], 3, 2, &place.device).expect("pixels are set");
        let rows = pixels.of(image.clone());
        assert_eq!(values(&rows), [6.0, 7.0, 8.0, 9.0, 10.0, 11.0], "{}", place.name);
        let pasted = values(&pixels.paste(rows * 0.0, image.clone()));
        let expected: Vec<f64> = (0..18).map(|i| if (6..12).contains(&i) { 0.0 } else { f64::from(i) }).collect();
        assert_eq!(pasted, expected, "{}", place.name);
        assert!(Pixels::masked(&[0; 6], 3, 2, &place.device).is_none());
        assert_eq!(values(&Pixels::all(3, 2, &place.device).of(image.clone())), values(&image));
    }
}
