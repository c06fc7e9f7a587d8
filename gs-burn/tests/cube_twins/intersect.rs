//! The lists of tiles and Gaussians.

use std::collections::BTreeSet;

use gs_burn::ops::intersect::DeviceCount;
use gs_kernels::config::tile_grid;
use gs_kernels::constants::{ALPHA_MIN, TILE};
use gs_kernels::cpu;
use gs_kernels::cube::intersect::{self, Intersections};
use gs_kernels::rows::ProjectedRow;

use super::support::{Random, Scene, client, down_u32, up};

/// Lists on the host, as the CPU twin has them.
fn lists(found: &Intersections) -> cpu::intersect::Intersections {
    let read = |buffer| down_u32(buffer).into_iter().map(|v| v as i32).collect();
    cpu::intersect::Intersections {
        tile_offsets: read(&found.tile_offsets),
        gaussian_ids: read(&found.gaussian_ids),
        gaussian_offsets: read(&found.gaussian_offsets),
        positions: read(&found.positions),
        places: Vec::new(),
    }
}

fn pairs(lists: &cpu::intersect::Intersections) -> BTreeSet<(usize, i32)> {
    let tiles = lists.tile_offsets.len() - 1;
    (0..tiles)
        .flat_map(|tile| {
            let range = lists.tile_offsets[tile] as usize..lists.tile_offsets[tile + 1] as usize;
            lists.gaussian_ids[range].iter().map(move |&id| (tile, id))
        })
        .collect()
}

/// The largest value of `opacity exp(-sigma)` over the tile's pixels.
fn brightest(row: &ProjectedRow<f32>, opacity: f32, tile: usize, width: u32, height: u32) -> f64 {
    let columns = tile_grid(width, height).0;
    let [d1, l, d2] = row.conic.map(f64::from);
    let mut best = 0.0f64;
    for y in tile / columns * TILE..(tile / columns * TILE + TILE).min(height as usize) {
        for x in tile % columns * TILE..(tile % columns * TILE + TILE).min(width as usize) {
            let dx = x as f64 + 0.5 - f64::from(row.mean[0]);
            let dy = y as f64 + 0.5 - f64::from(row.mean[1]);
            let u = dx + l * dy;
            best = best.max(f64::from(opacity) * (-0.5 * (d1 * u * u + d2 * dy * dy)).exp());
        }
    }
    best
}

fn check(projected: &[f32], opacities: &[f32], features: &[f32], width: u32, height: u32) {
    let (count, channels) = (opacities.len(), features.len() / opacities.len().max(1));
    let want = cpu::intersect::intersect(projected, opacities, features, width, height, channels);
    let inputs = [projected, opacities, features].map(up);
    let found = |room| {
        let [projected, opacities, features] = &inputs;
        let found = intersect::intersect(client(), projected, opacities, features, [width, height], channels, room);
        found.expect("intersect")
    };
    let counted = found(None);
    assert!(counted.words.is_none(), "the number was read");
    let got = lists(&counted.lists);
    println!("{} pairs of {count} Gaussians", got.gaussian_ids.len());

    // The twins may disagree where rounding decides, and only about pairs that no pixel will draw.
    let (got_pairs, want_pairs) = (pairs(&got), pairs(&want));
    let differing: Vec<_> = got_pairs.symmetric_difference(&want_pairs).collect();
    assert!(differing.len() <= 2 + want_pairs.len() / 1000, "{} of {} pairs differ", differing.len(), want_pairs.len());
    for &&(tile, id) in &differing {
        let row = ProjectedRow::read(projected, id as usize);
        let alpha = brightest(&row, opacities[id as usize], tile, width, height);
        assert!(alpha < ALPHA_MIN * (1.0 - 1e-4), "tile {tile}, Gaussian {id}: alpha {alpha}");
    }
    assert!(!differing.is_empty() || got == want, "same pairs, other lists");

    // Each tile in depth order, ties by index; each Gaussian's places rise and lead back to it.
    let key = |&id: &i32| (ProjectedRow::read(projected, id as usize).depth, id);
    for tile in 0..got.tile_offsets.len() - 1 {
        let range = got.tile_offsets[tile] as usize..got.tile_offsets[tile + 1] as usize;
        assert!(got.gaussian_ids[range].is_sorted_by(|a, b| key(a) < key(b)), "tile {tile}");
    }
    for id in 0..count {
        let range = got.gaussian_offsets[id] as usize..got.gaussian_offsets[id + 1] as usize;
        let places = &got.positions[range];
        assert!(places.is_sorted());
        assert!(places.iter().all(|&place| got.gaussian_ids[place as usize] == id as i32));
    }

    // Room changes no pair; too little empties all lists and tells so.
    let total = got.gaussian_ids.len();
    for room in [total, total + 1, total + 3000, total.saturating_sub(1), total / 2] {
        let found = found(Some(room));
        let words = found.words.expect("the number was not read").download::<f32>(client()).expect("the device works");
        assert_eq!(DeviceCount::of_words(&words), total);
        let within = lists(&found.lists);
        assert_eq!((within.gaussian_ids.len(), within.positions.len()), (room, room));
        if room >= total {
            assert_eq!(within.tile_offsets, got.tile_offsets);
            assert_eq!(within.gaussian_offsets, got.gaussian_offsets);
            assert_eq!(within.gaussian_ids[..total], got.gaussian_ids);
            assert_eq!(within.positions[..total], got.positions);
        } else {
            assert!(within.tile_offsets.iter().chain(&within.gaussian_offsets).all(|offset| *offset == 0));
        }
    }
}

#[test]
fn random_scene() {
    let scene = Scene::random(60, 700, 150, 83);
    let features = Random(61).list(700 * 3, 0.0, 1.0);
    check(&scene.projected(), &scene.opacities, &features, 150, 83);
}

#[test]
fn equal_depths_keep_their_order() {
    let scene = Scene::random(62, 300, 64, 64);
    let mut rows = scene.projected();
    for (index, row) in rows.chunks_mut(8).enumerate() {
        if row[7] > 0.0 {
            row[5] = 1.0 + (index % 3) as f32;
        }
    }
    check(&rows, &scene.opacities, &vec![0.5; 900], 64, 64);
}

#[test]
fn larger_than_the_image() {
    let mut scene = Scene::random(63, 60, 100, 40);
    scene.log_scales.iter_mut().for_each(|s| *s += 3.0);
    check(&scene.projected(), &scene.opacities, &[0.5; 60], 100, 40);
}

/// Many units emit the pairs of one Gaussian, and begin in the middle of its rows.
#[test]
fn a_few_over_many_tiles_among_small_ones() {
    let mut scene = Scene::random(66, 300, 310, 210);
    scene.log_scales[300..330].iter_mut().for_each(|s| *s += 4.0);
    check(&scene.projected(), &scene.opacities, &[0.5; 300], 310, 210);
}

#[test]
fn needles() {
    let mut scene = Scene::random(64, 200, 100, 100);
    for scales in scene.log_scales.chunks_mut(3) {
        scales.copy_from_slice(&[0.5, -8.0, -8.0]);
    }
    check(&scene.projected(), &scene.opacities, &[0.5; 200], 100, 100);
}

#[test]
fn unusable_gaussians_are_left_out() {
    let scene = Scene::random(65, 100, 64, 64);
    let (mut opacities, mut features) = (scene.opacities.clone(), vec![0.5; 200]);
    for (index, bad) in [f32::NAN, f32::INFINITY, -1.0, 0.0, 0.003].into_iter().enumerate() {
        opacities[10 * index] = bad;
    }
    for (index, bad) in [f32::NAN, -f32::INFINITY, 1e30, -1e38, 2e35].into_iter().enumerate() {
        features[20 * index + 11] = bad;
    }
    check(&scene.projected(), &opacities, &features, 64, 64);
}

#[test]
fn nobody() {
    check(&[], &[], &[], 40, 40);
    check(&[0.0; 80], &[0.5; 10], &[0.5; 10], 40, 40);
}
