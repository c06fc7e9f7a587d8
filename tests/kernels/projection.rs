//! `gs_burn::ops::projection`.

use burn::tensor::Tensor;
use gs_burn::ops::projection::{ProjectionConfig, project, project_reference};
use gs_kernels::constants::CUTOFF_SIGMAS;
use gs_kernels::rows::{PROJECTED, ProjectedRow};
use gs_tests::devices::{Place, everywhere, reference};
use gs_tests::scenes::{IDENTITY, Leaves, Scene};
use gs_tests::tolerance::{FORWARD_F32, FORWARD_F64, assert_near, assert_near_scaled, column, largest, values};

/// 64 x 48 pixels, focal lengths 100 and 120, centred.
fn camera() -> ProjectionConfig {
    ProjectionConfig { width: 64, height: 48, fx: 100.0, fy: 120.0, cx: 32.0, cy: 24.0, ..Default::default() }
}

/// The row of one Gaussian seen from the origin.
fn row_of(place: &Place, mean: [f64; 3], quat: [f64; 4], scales: [f64; 3], camera: &ProjectionConfig) -> Vec<f64> {
    values(&project(
        place.tensor(&mean, [1, 3]),
        place.tensor(&quat, [1, 4]),
        place.tensor(&scales.map(f64::ln), [1, 3]),
        place.tensor(&IDENTITY, [4, 4]),
        camera,
    ))
}

/// The row of a 2D covariance, not anti-aliased.
fn row_from(mean: [f64; 2], [xx, xy, yy]: [f64; 3], depth: f64) -> Vec<f64> {
    let conic = [yy / (xx * yy - xy * xy), -xy / yy, 1.0 / yy];
    ProjectedRow { mean, conic, depth, compensation: 1.0, radius: CUTOFF_SIGMAS * xx.max(yy).sqrt() }.pack().to_vec()
}

#[test]
fn sphere_on_the_axis() {
    for place in everywhere() {
        let row = row_of(place, [0.0, 0.0, 2.0], [1.0, 0.0, 0.0, 0.0], [0.1; 3], &camera());
        // sigma = 0.1 is 5 pixels across and 6 down at depth 2, widened by 0.3 square pixels.
        assert_near_scaled(&place.name, &row, &row_from([32.0, 24.0], [25.3, 0.0, 36.3], 2.0), FORWARD_F32);
    }
}

#[test]
fn sphere_off_the_axis() {
    for place in everywhere() {
        let row = row_of(place, [0.2, -0.1, 2.0], [3.0, 0.0, 0.0, 0.0], [0.1; 3], &camera());
        // Rows of the Jacobian: [50, 0, -5] and [0, 60, 3]; times 0.1 and squared.
        let expected = row_from([42.0, 18.0], [25.25 + 0.3, -0.15, 36.09 + 0.3], 2.0);
        assert_near_scaled(&place.name, &row, &expected, FORWARD_F32);
    }
}

#[test]
fn quaternion_turns_the_axes() {
    for place in everywhere() {
        // A quarter turn about z (any norm) exchanges x and y; the third scale points at the camera.
        let row = row_of(place, [0.0, 0.0, 2.0], [5.0, 0.0, 0.0, 5.0], [0.1, 0.2, 0.05], &camera());
        assert_near_scaled(&place.name, &row, &row_from([32.0, 24.0], [100.3, 0.0, 36.3], 2.0), FORWARD_F32);
        // An eighth turn: the long axis runs along x = y in the world, down and to the right in the image.
        let (s, c) = (std::f64::consts::PI / 8.0).sin_cos();
        let row = row_of(place, [0.0, 0.0, 2.0], [c, 0.0, 0.0, s], [0.2, 0.1, 0.05], &camera());
        let expected = row_from([32.0, 24.0], [62.5 + 0.3, 45.0, 90.0 + 0.3], 2.0);
        assert_near_scaled(&place.name, &row, &expected, FORWARD_F32);
    }
}

#[test]
fn compensation_keeps_the_light() {
    for place in everywhere() {
        let camera = ProjectionConfig { antialiased: true, ..camera() };
        let row = row_of(place, [0.0, 0.0, 2.0], [1.0, 0.0, 0.0, 0.0], [0.01; 3], &camera);
        // 0.25 x 0.36 square pixels of variance before the dilation, 0.55 x 0.66 after.
        let expected = (0.25 * 0.36_f64 / (0.55 * 0.66)).sqrt();
        assert_near(&place.name, &[ProjectedRow::read(&row, 0).compensation], &[expected], FORWARD_F32);
    }
}

#[test]
fn pose_moves_before_projecting() {
    for place in everywhere() {
        // The camera stands at x = 3 and looks along -x: its z axis is -x, its x axis is z.
        let viewmat = [0., 0., 1., 0., 0., 1., 0., 0., -1., 0., 0., 3., 0., 0., 0., 1.];
        let row = values(&project(
            place.tensor(&[1.0, 0.1, 0.2], [1, 3]),
            place.tensor(&[1.0, 0.0, 0.0, 0.0], [1, 4]),
            place.tensor(&[0.1_f64.ln(); 3], [1, 3]),
            place.tensor(&viewmat, [4, 4]),
            &camera(),
        ));
        let row = ProjectedRow::read(&row, 0);
        assert_near(&place.name, &[row.mean[0], row.mean[1], row.depth], &[42.0, 30.0, 2.0], FORWARD_F32);
    }
}

#[test]
fn what_cannot_be_seen_is_zero() {
    let (mean, quat, scales) = ([0.0, 0.0, 2.0], [1.0, 0.0, 0.0, 0.0], [0.1; 3]);
    let (nan, inf) = (f64::NAN, f64::INFINITY);
    for place in everywhere() {
        let is_culled = |mean, quat, scales, camera: &ProjectionConfig| {
            row_of(place, mean, quat, scales, camera).iter().all(|x| *x == 0.0)
        };
        let near = ProjectionConfig { near: 2.5, ..camera() };
        let far = ProjectionConfig { far: 1.5, ..camera() };
        assert!(is_culled(mean, quat, scales, &near) && is_culled(mean, quat, scales, &far), "{}: planes", place.name);
        for mean in [[0.0, 0.0, -2.0], [0.0; 3], [50.0, 0.0, 2.0], [0.0, -50.0, 2.0], [nan, 0.0, 2.0], [0.0, 0.0, inf]]
        {
            assert!(is_culled(mean, quat, scales, &camera()), "{}: mean {mean:?}", place.name);
        }
        for quat in [[0.0; 4], [1e-20, 0.0, 0.0, 0.0], [nan, 1.0, 0.0, 0.0], [inf, 0.0, 0.0, 0.0], [1e19; 4]] {
            assert!(is_culled(mean, quat, scales, &camera()), "{}: quat {quat:?}", place.name);
        }
        for scales in [[nan, 0.1, 0.1], [1e30, 0.1, 0.1], [inf, 0.1, 0.1]] {
            assert!(is_culled(mean, quat, scales, &camera()), "{}: scales {scales:?}", place.name);
        }
        assert!(!is_culled(mean, [1e-17, 0.0, 0.0, 0.0], [1e-30; 3], &camera()), "{}: a point is seen", place.name);
    }
}

fn rows(scene: &Scene, place: &Place) -> Vec<f64> {
    let Leaves { means, quats, log_scales, viewmat, .. } = scene.leaves(place);
    values(&project(means, quats, log_scales, viewmat, &scene.config))
}

#[test]
fn every_device_follows_the_reference() {
    for antialiased in [false, true] {
        let mut scene = Scene::random(300, 1);
        scene.config.antialiased = antialiased;
        let expected = scene.reference_rows();
        let visible = expected.chunks(PROJECTED).filter(|row| ProjectedRow::read(row, 0).radius > 0.0).count();
        assert!(visible > 200, "{visible} of 300 are visible");
        for place in everywhere() {
            let actual = rows(&scene, place);
            for c in 0..PROJECTED {
                let [actual, expected] = [&actual, &expected].map(|rows| column(rows, PROJECTED, c));
                let what = format!("column {c} on {}", place.name);
                if place.is_double() {
                    assert_near(&what, &actual, &expected, FORWARD_F64 * largest(&expected));
                } else {
                    assert_near_scaled(&what, &actual, &expected, FORWARD_F32);
                }
            }
        }
    }
}

#[test]
#[should_panic(expected = "axis 1 expected 4, got 3")]
fn a_wrong_shape_is_named() {
    let scene = Scene::random(2, 4);
    let Leaves { means, log_scales, viewmat, .. } = scene.leaves(reference());
    project(means, log_scales.clone(), log_scales, viewmat, &scene.config);
}

#[test]
fn no_gaussians_no_rows() {
    for place in everywhere() {
        let empty = |columns| Tensor::<2>::zeros([0, columns], (&place.device, place.dtype));
        for project in [project, project_reference] {
            let viewmat = place.tensor(&IDENTITY, [4, 4]);
            let rows = project(empty(3), empty(4), empty(3), viewmat, &camera());
            assert_eq!(rows.dims(), [0, PROJECTED], "{}", place.name);
        }
    }
    assert!(reference().is_double());
}
