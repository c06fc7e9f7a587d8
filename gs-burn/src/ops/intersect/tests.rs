use std::collections::BTreeSet;

use super::*;
use crate::ops::projection::{ProjectionConfig, project};
use crate::testing::{Random, Scene, values};

fn ints(tensor: &Tensor<1, Int>) -> Vec<i32> {
    tensor.to_data().iter::<i32>().collect()
}

fn pairs(lists: &TileIntersections) -> BTreeSet<(usize, i32)> {
    let (offsets, ids) = (ints(&lists.tile_offsets), ints(&lists.gaussian_ids));
    let tile = |place: usize| offsets.partition_point(|&offset| offset as usize <= place) - 1;
    ids.iter().enumerate().map(|(place, &id)| (tile(place), id)).collect()
}

fn inputs(seed: u64) -> (Tensor<2>, Tensor<1>, Tensor<2>) {
    let scene = Scene::random(60, 0, seed);
    let config = ProjectionConfig { width: 90, height: 70, fx: 70.0, fy: 75.0, cx: 44.0, cy: 36.0, ..scene.config };
    let projected = project(scene.means, scene.quats, scene.log_scales, scene.viewmat, &config);
    (projected, burn::tensor::activation::sigmoid(scene.opacity_logits), Random(seed).tensor([60, 3], 0.0, 1.0))
}

#[test]
fn kernel_lists_what_the_reference_lists() {
    for seed in 0..8 {
        let (projected, opacities, features) = inputs(seed);
        let [actual, expected] = [intersect, intersect_reference]
            .map(|intersect| intersect(projected.clone(), opacities.clone(), features.clone(), 90, 70));
        let (found, wanted) = (pairs(&actual), pairs(&expected));
        assert!(wanted.is_subset(&found), "missing {:?}", wanted.difference(&found).collect::<Vec<_>>());
        // An ellipse may pass between pixel centres of a tile at its rim.
        assert!(found.len() <= wanted.len() + wanted.len() / 10 + 2, "{} for {}", found.len(), wanted.len());
    }
}

#[test]
fn lists_are_consistent_and_in_depth_order() {
    let (projected, opacities, features) = inputs(11);
    let depths: Vec<f64> = values(&projected).chunks(8).map(|row| row[5]).collect();
    for intersect in [intersect, intersect_reference] {
        let lists = intersect(projected.clone(), opacities.clone(), features.clone(), 90, 70);
        let (tiles, ids) = (ints(&lists.tile_offsets), ints(&lists.gaussian_ids));
        let (owners, places) = (ints(&lists.gaussian_offsets), ints(&lists.positions));
        assert_eq!(tiles.len(), 6 * 5 + 1);
        assert_eq!((*tiles.last().unwrap() as usize, *owners.last().unwrap() as usize), (ids.len(), places.len()));
        for tile in tiles.windows(2) {
            let ids = &ids[tile[0] as usize..tile[1] as usize];
            assert!(ids.windows(2).all(|w| (depths[w[0] as usize], w[0]) < (depths[w[1] as usize], w[1])));
        }
        for gaussian in 0..60 {
            let places = &places[owners[gaussian] as usize..owners[gaussian + 1] as usize];
            assert!(places.windows(2).all(|w| w[0] < w[1]));
            assert!(places.iter().all(|&place| ids[place as usize] == gaussian as i32));
        }
    }
}

#[test]
fn unusable_gaussians_are_left_out() {
    let (projected, _, _) = inputs(12);
    let mut opacities = vec![0.5; 60];
    let mut features = vec![0.5; 180];
    opacities[0] = 0.001;
    opacities[1] = f64::NAN;
    features[3 * 2] = f64::INFINITY;
    features[3 * 3 + 1] = gs_kernels::constants::INVALID_FEATURE;
    let (opacities, features) = (crate::testing::tensor(opacities, [60]), crate::testing::tensor(features, [60, 3]));
    for intersect in [intersect, intersect_reference] {
        let lists = intersect(projected.clone(), opacities.clone(), features.clone(), 90, 70);
        let ids = ints(&lists.gaussian_ids);
        assert!(!ids.is_empty() && ids.iter().all(|id| *id > 3), "{ids:?}");
    }
}
