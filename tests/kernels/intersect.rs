//! `gs_burn::ops::intersect`.

use std::collections::BTreeSet;

use burn::tensor::Tensor;
use gs_burn::ops::intersect::{TileIntersections, intersect, intersect_reference};
use gs_kernels::config::tile_grid;
use gs_kernels::constants::INVALID_FEATURE;
use gs_kernels::rows::{PROJECTED, ProjectedRow};
use gs_tests::devices::{Place, everywhere, reference};
use gs_tests::scenes::Scene;
use gs_tests::tolerance::indices;

type Intersect = fn(Tensor<2>, Tensor<1>, Tensor<2>, usize, usize) -> TileIntersections;

/// [`TileIntersections`] on the host.
#[derive(Debug, PartialEq)]
struct Lists {
    tile_offsets: Vec<usize>,
    gaussian_ids: Vec<usize>,
    gaussian_offsets: Vec<usize>,
    positions: Vec<usize>,
}

impl Lists {
    fn read(lists: &TileIntersections) -> Self {
        Self {
            tile_offsets: indices(&lists.tile_offsets),
            gaussian_ids: indices(&lists.gaussian_ids),
            gaussian_offsets: indices(&lists.gaussian_offsets),
            positions: indices(&lists.positions),
        }
    }

    fn of(place: &Place, rows: &[f64], opacities: &[f64], [width, height]: [usize; 2]) -> Self {
        let count = opacities.len();
        let rows = place.tensor(rows, [count, PROJECTED]);
        let features = place.tensor(&vec![0.5; 3 * count], [count, 3]);
        Self::read(&intersect(rows, place.tensor(opacities, [count]), features, width, height))
    }

    fn tiles(&self) -> impl Iterator<Item = &[usize]> {
        self.tile_offsets.windows(2).map(|w| &self.gaussian_ids[w[0]..w[1]])
    }

    fn pairs(&self) -> BTreeSet<(usize, usize)> {
        self.tiles().enumerate().flat_map(|(tile, ids)| ids.iter().map(move |id| (tile, *id))).collect()
    }

    /// Asserts what holds for any lists: every tile in depth order with ties by index, and the two orders inverse.
    #[track_caller]
    fn assert_consistent(&self, case: &str, rows: &[f64], [width, height]: [usize; 2]) {
        let (columns, lines) = tile_grid(width as u32, height as u32);
        let count = rows.len() / PROJECTED;
        assert_eq!(self.tile_offsets.len(), columns * lines + 1, "{case}: tile offsets");
        assert_eq!(self.gaussian_offsets.len(), count + 1, "{case}: Gaussian offsets");
        assert_eq!(self.tile_offsets.last(), Some(&self.gaussian_ids.len()), "{case}: last tile");
        assert_eq!(self.gaussian_offsets.last(), Some(&self.positions.len()), "{case}: last Gaussian");
        assert_eq!(self.positions.len(), self.gaussian_ids.len(), "{case}: both orders hold the same pairs");
        let depth = |id: usize| ProjectedRow::read(rows, id).depth;
        for (tile, ids) in self.tiles().enumerate() {
            let sorted = ids.windows(2).all(|w| (depth(w[0]), w[0]) < (depth(w[1]), w[1]));
            assert!(sorted, "{case}: tile {tile} is not in depth order");
        }
        for (id, w) in self.gaussian_offsets.windows(2).enumerate() {
            let places = &self.positions[w[0]..w[1]];
            assert!(places.windows(2).all(|w| w[0] < w[1]), "{case}: positions of {id} do not rise");
            assert!(places.iter().all(|place| self.gaussian_ids[*place] == id), "{case}: positions of {id} miss it");
        }
    }
}

/// A row of a 2D covariance.
fn row(mean: [f64; 2], [xx, xy, yy]: [f64; 3], depth: f64) -> Vec<f64> {
    let conic = [yy / (xx * yy - xy * xy), -xy / yy, 1.0 / yy];
    ProjectedRow { mean, conic, depth, compensation: 1.0, radius: 3.33 * xx.max(yy).sqrt() }.pack().to_vec()
}

/// Rows that `f32` holds exactly, so that depths are the same numbers on every device.
fn rounded_rows(scene: &Scene) -> Vec<f64> {
    scene.reference_rows().into_iter().map(|x| f64::from(x as f32)).collect()
}

#[test]
fn hand_counted_tiles() {
    // 64 x 48 pixels: 4 x 3 tiles.
    for place in everywhere() {
        let tiles = |mean, covariance, opacity| -> Vec<usize> {
            let lists = Lists::of(place, &row(mean, covariance, 1.0), &[opacity], [64, 48]);
            lists.pairs().into_iter().map(|(tile, _)| tile).collect()
        };
        let name = &place.name;
        assert_eq!(tiles([24.0, 24.0], [1.0, 0.0, 1.0], 1.0), [5], "a dot in the middle of a tile, {name}");
        assert_eq!(tiles([32.0, 32.0], [1.0, 0.0, 1.0], 1.0), [5, 6, 9, 10], "a dot on a corner, {name}");
        assert_eq!(tiles([24.0, 24.0], [9.0, 0.0, 9.0], 1.0), [1, 4, 5, 6, 9], "a disc of 10 pixels, {name}");
        assert_eq!(tiles([24.0, 24.0], [9.0, 0.0, 9.0], 0.02), [5], "the same, faint: 5.4 pixels, {name}");
        assert!(tiles([24.0, 24.0], [9.0, 0.0, 9.0], 0.003).is_empty(), "below the cut-off, {name}");
        assert_eq!(tiles([-5.0, 8.0], [9.0, 0.0, 9.0], 1.0), [0], "from outside, {name}");
        // A needle along the diagonal passes two corners without touching the tiles beside them.
        assert_eq!(tiles([24.0, 24.0], [100.0, 99.98, 100.0], 1.0), [0, 5, 10], "a needle, {name}");
    }
}

#[test]
fn equal_depths_go_by_index() {
    for place in everywhere() {
        for count in [2, 255, 256, 257, 1025] {
            let rows: Vec<f64> =
                (0..count).flat_map(|i| row([8.0, 8.0], [4.0, 0.0, 4.0], if i % 3 == 0 { 1.0 } else { 2.0 })).collect();
            let lists = Lists::of(place, &rows, &vec![0.9; count], [16, 16]);
            let (front, back): (Vec<usize>, Vec<usize>) = (0..count).partition(|i| i % 3 == 0);
            assert_eq!(lists.gaussian_ids, [front, back].concat(), "{count} on {}", place.name);
        }
    }
}

/// Scans and sorts work in blocks: counts around powers of two, and tile grids that are prime, narrow or a single tile
/// (a transposed tile index shows on no square grid).
#[test]
fn every_size_lists_what_the_reference_lists() {
    let sizes = [[53, 37], [1, 1], [109, 77], [208, 17], [17, 208], [16, 16], [48, 48]];
    let counts = [1, 2, 31, 32, 33, 255, 256, 257];
    for (k, [width, height]) in sizes.into_iter().enumerate() {
        for count in if k == 0 { &counts[..] } else { &[40][..] } {
            let scene = Scene::random(*count, 4).resized(width as u32, height as u32);
            let (rows, opacities) = (rounded_rows(&scene), scene.opacities());
            let place = reference();
            let features = place.tensor(&vec![0.5; 3 * count], [*count, 3]);
            let lists = intersect_reference(
                place.tensor(&rows, [*count, PROJECTED]),
                place.tensor(&opacities, [*count]),
                features,
                width,
                height,
            );
            let lists = Lists::read(&lists);
            lists.assert_consistent("the reference", &rows, [width, height]);
            let wanted = lists.pairs();
            for place in everywhere() {
                let case = format!("{count} in {width}x{height} on {}", place.name);
                let lists = Lists::of(place, &rows, &opacities, [width, height]);
                lists.assert_consistent(&case, &rows, [width, height]);
                let found = lists.pairs();
                // A pair at the cut-off may round away: it would add 1/255 to no pixel but one at the rim.
                let missing = wanted.difference(&found).count();
                assert!(missing == 0, "{case}: {missing} of {} pairs are missing", wanted.len());
                // An ellipse may pass between the pixel centres of a tile at its rim.
                let most = wanted.len() + wanted.len() / 10 + 4;
                assert!(found.len() <= most, "{case}: {} pairs for {}", found.len(), wanted.len());
            }
        }
    }
}

#[test]
fn many_gaussians_are_sorted() {
    for place in everywhere() {
        for count in [4095, 4096, 4097, 20_000] {
            let scene = Scene::random(count, 5).resized(208, 112);
            let (rows, opacities) = (rounded_rows(&scene), scene.opacities());
            let lists = Lists::of(place, &rows, &opacities, [208, 112]);
            assert!(lists.gaussian_ids.len() > count, "{} pairs", lists.gaussian_ids.len());
            lists.assert_consistent(&format!("{count} on {}", place.name), &rows, [208, 112]);
        }
    }
}

#[test]
fn unusable_gaussians_are_left_out() {
    let scene = Scene::random(60, 12).resized(90, 70);
    let rows = rounded_rows(&scene);
    let (mut opacities, mut features) = (vec![0.5; 60], vec![0.5; 180]);
    (opacities[0], opacities[1]) = (0.001, f64::NAN);
    (features[3 * 2], features[3 * 3 + 1]) = (f64::INFINITY, INVALID_FEATURE);
    for (place, intersect) in everywhere()
        .map(|place| (place, intersect as Intersect))
        .chain([(reference(), intersect_reference as Intersect)])
    {
        let features = place.tensor(&features, [60, 3]);
        let lists = intersect(place.tensor(&rows, [60, PROJECTED]), place.tensor(&opacities, [60]), features, 90, 70);
        let ids = indices(&lists.gaussian_ids);
        assert!(!ids.is_empty() && ids.iter().all(|id| *id > 3), "{ids:?} on {}", place.name);
    }
}

#[test]
fn nothing_meets_nothing() {
    for place in everywhere() {
        let lists = Lists::of(place, &[], &[], [33, 20]);
        let expected =
            Lists { tile_offsets: vec![0; 7], gaussian_ids: vec![], gaussian_offsets: vec![0], positions: vec![] };
        assert_eq!(lists, expected, "{}", place.name);
        let behind = Lists::of(place, &[0.0; 5 * PROJECTED], &[0.9; 5], [33, 20]);
        assert!(behind.gaussian_ids.is_empty(), "{}", place.name);
        assert_eq!(behind.gaussian_offsets, [0; 6], "{}", place.name);
    }
}
