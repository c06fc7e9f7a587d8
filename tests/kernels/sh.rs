//! `gs_burn::ops::sh`.

use burn::tensor::Tensor;
use gs_burn::ops::sh::{sh_colors, sh_colors_reference};
use gs_kernels::constants::INVALID_FEATURE;
use gs_kernels::rows::{PROJECTED, ProjectedRow};
use gs_tests::devices::{Place, doubles, everywhere, reference, singles};
use gs_tests::scenes::{IDENTITY, Leaves, Random, Scene};
use gs_tests::tolerance::{FORWARD_F32, FORWARD_F64, assert_near, assert_near_scaled, values};

/// Rows in which Gaussian `i` is visible when `radii[i]` is not 0.
fn rows_with(radii: &[f64]) -> Vec<f64> {
    let row = |&radius| ProjectedRow { mean: [0.0; 2], conic: [0.0; 3], depth: 0.0, compensation: 0.0, radius }.pack();
    radii.iter().flat_map(row).collect()
}

/// Colour of one Gaussian at `mean` seen from the origin.
fn color_of(place: &Place, mean: [f64; 3], sh: &[f64], degree: usize) -> Vec<f64> {
    values(&sh_colors(
        place.tensor(&mean, [1, 3]),
        place.tensor(sh, [1, sh.len() / 3, 3]),
        place.tensor(&IDENTITY, [4, 4]),
        place.tensor(&rows_with(&[1.0]), [1, PROJECTED]),
        degree,
    ))
}

/// 16 coefficients of which one is 1 in all channels.
fn only(k: usize) -> Vec<f64> {
    (0..48).map(|i| if i / 3 == k { 1.0 } else { 0.0 }).collect()
}

#[test]
fn degree_0_is_the_same_from_everywhere() {
    for place in everywhere() {
        for mean in [[0.0, 0.0, 2.0], [1.0, -3.0, 0.5]] {
            let color = color_of(place, mean, &[1.0, 0.0, -1.0], 0);
            assert_near(&place.name, &color, &[0.5 + 0.2820948, 0.5, 0.5 - 0.2820948], FORWARD_F32);
        }
    }
}

#[test]
fn negative_light_is_black() {
    for place in everywhere() {
        let color = color_of(place, [0.0, 0.0, 1.0], &[-3.0, 3.0, 0.0], 0);
        assert_near(&place.name, &color, &[0.0, 0.5 + 3.0 * 0.2820948, 0.5], FORWARD_F32);
    }
}

/// The 3DGS signs: the basis at the three axes, where all but a few functions vanish.
#[test]
fn basis_at_the_axes() {
    let along = |axis: usize| std::array::from_fn(|i| if i == axis { 3.0 } else { 0.0 });
    // (coefficient, axis, value): Y_1 and Y_3 are odd, so also seen with both signs below.
    let cases = [
        (1, 1, -0.4886025),
        (2, 2, 0.4886025),
        (3, 0, -0.4886025),
        (6, 2, 2.0 * 0.3153916),
        (6, 0, -0.3153916),
        (8, 0, 0.5462742),
        (8, 1, -0.5462742),
        (9, 1, 0.5900436),
        (12, 2, 2.0 * 0.3731763),
        (15, 0, -0.5900436),
        (4, 0, 0.0),
        (10, 2, 0.0),
        (14, 2, 0.0),
    ];
    for place in everywhere() {
        for (k, axis, value) in cases {
            // A quarter of it, so that the colour stays positive.
            let sh: Vec<f64> = only(k).iter().map(|x| 0.25 * x).collect();
            let color = color_of(place, along(axis), &sh, 3);
            assert_near(
                &format!("Y_{k} along {axis} on {}", place.name),
                &color,
                &[0.5 + 0.25 * value; 3],
                FORWARD_F32,
            );
        }
    }
}

#[test]
fn inactive_degrees_do_not_count() {
    for place in everywhere() {
        for (k, first_degree) in [(0, 0), (3, 1), (8, 2), (15, 3)] {
            for degree in 0..=3 {
                let color = color_of(place, [1.0, 0.0, 0.0], &only(k), degree);
                assert_eq!(color != vec![0.5; 3], degree >= first_degree, "Y_{k} at {degree} on {}", place.name);
            }
        }
    }
}

#[test]
fn what_is_not_drawn_is_marked() {
    for place in everywhere() {
        let mut sh = vec![0.0; 3 * 3];
        sh[4] = f64::NAN;
        let colors = values(&sh_colors(
            place.tensor(&[0.0, 0.0, 1.0].repeat(3), [3, 3]),
            place.tensor(&sh, [3, 1, 3]),
            place.tensor(&IDENTITY, [4, 4]),
            place.tensor(&rows_with(&[1.0, 1.0, 0.0]), [3, PROJECTED]),
            0,
        ));
        let invalid = f64::from(INVALID_FEATURE as f32);
        let marked: Vec<f64> = colors.iter().map(|c| if *c == INVALID_FEATURE { invalid } else { *c }).collect();
        assert_eq!(marked, [[0.5; 3], [invalid; 3], [0.0; 3]].concat(), "{}", place.name);
    }
}

#[test]
fn every_device_follows_the_reference() {
    for (degree, coefficients) in [(0, 1), (0, 16), (1, 4), (1, 16), (2, 9), (2, 16), (3, 16)] {
        let scene = Scene::random(200, 2);
        let rows = scene.reference_rows();
        let sh = Random::new(3).values(200 * coefficients * 3, -0.5, 0.5);
        let colors = |place: &Place, sh_colors: fn(_, _, _, _, _) -> Tensor<2>| {
            let Leaves { means, viewmat, .. } = scene.leaves(place);
            let rows = place.tensor(&rows, [200, PROJECTED]).autodiff();
            values(&sh_colors(means, place.leaf(&sh, [200, coefficients, 3]), viewmat, rows, degree))
        };
        let expected = colors(reference(), sh_colors_reference);
        for place in doubles() {
            assert_near_scaled(&place.name, &colors(place, sh_colors), &expected, FORWARD_F64);
        }
        for place in singles() {
            assert_near(&place.name, &colors(place, sh_colors), &expected, FORWARD_F32);
        }
    }
}
