//! The lists of the tiles of several instants.

use gs_burn::ops::intersect::DeviceCount;
use gs_kernels::config::{Room, tile_grid};
use gs_kernels::cpu::exposure as cpu;
use gs_kernels::cpu::intersect::Intersections;
use gs_kernels::cube::intersect::{FoundInstants, InstantRows, intersect, intersect_instants};
use gs_kernels::rows::PROJECTED;

use super::support::{Random, Scene, client, down_u32, up, up_u32};

/// A table of rows: `scene` at the first instant, then the rows `moving` at each further one.
struct Table {
    projected: Vec<f32>,
    opacities: Vec<f32>,
    features: Vec<f32>,
    scene: usize,
    moving: Vec<u32>,
    size: [u32; 2],
}

impl Table {
    /// Every `every`th of `count` Gaussians moves by up to `step` pixels along x and y between `instants`.
    fn random(seed: u64, count: usize, every: usize, instants: usize, step: f32, size: [u32; 2]) -> Self {
        let scene = Scene::random(seed, count, size[0], size[1]);
        let (mut projected, mut opacities) = (scene.projected(), scene.opacities.clone());
        let mut random = Random(seed + 1);
        let mut features = random.list(count * 3, 0.0, 1.0);
        let moving: Vec<u32> = (0..count as u32).filter(|row| *row as usize % every == every - 1).collect();
        let steps = random.list(2 * moving.len(), -step, step);
        for instant in 1..instants {
            for (k, row) in moving.iter().map(|row| *row as usize).enumerate() {
                let mut at = projected[row * PROJECTED..][..PROJECTED].to_vec();
                at[0] += instant as f32 * steps[2 * k];
                at[1] += instant as f32 * steps[2 * k + 1];
                projected.extend(at);
                opacities.push(opacities[row]);
                features.extend_from_within(3 * row..3 * row + 3);
            }
        }
        Self { projected, opacities, features, scene: count, moving, size }
    }

    fn on_cpu(&self) -> (Intersections, cpu::TileShares) {
        let [width, height] = self.size;
        cpu::intersect_instants(
            &self.projected,
            &self.opacities,
            &self.features,
            width,
            height,
            3,
            self.scene,
            &self.moving,
        )
    }

    fn found(&self, room: Option<Room>) -> FoundInstants {
        let [projected, opacities, features] = &[&self.projected, &self.opacities, &self.features].map(|v| up(v));
        let moving = &up_u32(&self.moving);
        let table = InstantRows { projected, opacities, features, scene: self.scene, moving };
        intersect_instants(client(), table, self.size, 3, room).expect("lists")
    }

    fn grid(&self) -> usize {
        let (columns, rows) = tile_grid(self.size[0], self.size[1]);
        columns * rows
    }

    /// Row of the table that is Gaussian `number` of the scene at `instant`.
    fn row(&self, number: usize, instant: usize) -> usize {
        match self.moving.binary_search(&(number as u32)) {
            Ok(mover) if instant > 0 => self.scene + (instant - 1) * self.moving.len() + mover,
            _ => number,
        }
    }

    /// The device's lists of the whole scene at `instant`.
    fn alone(&self, instant: usize) -> Intersections {
        let rows: Vec<usize> = (0..self.scene).map(|number| self.row(number, instant)).collect();
        let taken = |values: &[f32], columns: usize| -> Vec<f32> {
            rows.iter().flat_map(|row| values[row * columns..][..columns].iter().copied()).collect()
        };
        let inputs = [(&self.projected, PROJECTED), (&self.opacities, 1), (&self.features, 3)];
        let [projected, opacities, features] = inputs.map(|(values, columns)| up(&taken(values, columns)));
        let found = intersect(client(), &projected, &opacities, &features, self.size, 3, None).expect("lists").lists;
        Intersections {
            tile_offsets: down_i32(&found.tile_offsets),
            gaussian_ids: down_i32(&found.gaussian_ids),
            gaussian_offsets: Vec::new(),
            positions: Vec::new(),
            places: Vec::new(),
        }
    }

    /// Each tile's list at each instant is the device's own for the whole scene then.
    fn check_instants(&self, got: &Intersections, shares: &cpu::TileShares) {
        let list =
            |drawn: usize| &got.gaussian_ids[got.tile_offsets[drawn] as usize..got.tile_offsets[drawn + 1] as usize];
        let movers = self.moving.len();
        for instant in 0..shares.instants {
            let alone = self.alone(instant);
            let first = self.scene + instant.saturating_sub(1) * movers;
            let is_of = |id: &i32, from: usize, to: usize| (from..to).contains(&(*id as usize));
            for tile in 0..self.grid() {
                let extras = shares.extra_offsets[tile] as usize..shares.extra_offsets[tile + 1] as usize;
                let mut extras = extras.map(|extra| self.grid() + extra);
                let touching =
                    extras.clone().find(|extra| list(*extra).iter().any(|id| is_of(id, first, first + movers)));
                let bare = extras.find(|extra| !list(*extra).iter().any(|id| is_of(id, self.scene, usize::MAX)));
                let shown = if instant == 0 { tile } else { touching.or(bare).unwrap_or(tile) };
                let expected = alone.tile_offsets[tile] as usize..alone.tile_offsets[tile + 1] as usize;
                let expected =
                    alone.gaussian_ids[expected].iter().map(|number| self.row(*number as usize, instant) as i32);
                assert!(list(shown).iter().copied().eq(expected), "tile {tile} at instant {instant}");
            }
        }
    }

    /// The device's lists are those of each instant alone and, but for pairs that rounding decides, the CPU's; room
    /// changes no number, and with too little all lists are empty.
    fn check(&self) {
        let (want, shares) = self.on_cpu();
        let counted = self.found(None);
        assert!(counted.words.is_none(), "the numbers were read");
        let got = lists(&counted);
        let (pairs, tiles) = (got.gaussian_ids.len(), got.places.len());
        println!("{pairs} pairs in {tiles} lists of {} tiles", self.grid());
        let own_shares = cpu::TileShares::of_numbers(&down_i32(&counted.shares), self.grid(), shares.instants);
        self.check_instants(&got, &own_shares);
        let different = pairs.abs_diff(want.gaussian_ids.len());
        assert!(different <= 2 + pairs / 1000, "{pairs} pairs, {different} more or fewer than on the CPU");
        assert!(different > 0 || (&got, &own_shares) == (&want, &shares), "as many pairs, other lists");
        for row in 0..got.gaussian_offsets.len() - 1 {
            let places = &got.positions[got.gaussian_offsets[row] as usize..got.gaussian_offsets[row + 1] as usize];
            assert!(places.is_sorted_by(|a, b| a < b));
            assert!(places.iter().all(|&place| got.gaussian_ids[place as usize] == row as i32));
        }
        let want = got;
        let shares = own_shares;

        let room = |pairs, tiles| Room { pairs, tiles };
        for room in
            [room(pairs, tiles), room(pairs + 1, tiles), room(pairs, tiles + 1), room(2 * pairs + 999, 3 * tiles)]
        {
            let found = self.found(Some(room));
            assert_eq!(numbers(&found), [pairs, tiles]);
            let within = lists(&found);
            assert_eq!(within.tile_offsets[..tiles + 1], want.tile_offsets);
            assert!(within.tile_offsets[tiles..].iter().all(|offset| *offset as usize == pairs), "empty lists behind");
            assert_eq!(within.gaussian_offsets, want.gaussian_offsets);
            assert_eq!(within.gaussian_ids[..pairs], want.gaussian_ids);
            assert_eq!(within.positions[..pairs], want.positions);
            // Places behind the last pair lead to themselves, where no tile's list is.
            assert!((pairs..room.pairs).all(|k| within.positions[k] as usize == k));
            let own = down_i32(&found.shares);
            let (grid, wanted) = (self.grid(), shares.numbers());
            assert_eq!(own[..grid + 1 + tiles], wanted);
            assert!(own[grid + 1 + tiles..].iter().all(|count| *count == 0));
        }
        for room in [room(pairs - 1, tiles), room(pairs / 3, tiles), room(pairs, tiles - 1)] {
            let found = self.found(Some(room));
            let [found_pairs, found_tiles] = numbers(&found);
            assert!(found_pairs > room.pairs || found_tiles > room.tiles.max(self.grid()), "the numbers tell");
            let within = lists(&found);
            assert!(within.tile_offsets.iter().chain(&within.gaussian_offsets).all(|offset| *offset == 0));
            let (grid, instants) = (self.grid(), shares.instants as i32);
            let own = down_i32(&found.shares);
            assert!(own[..=grid].iter().all(|offset| *offset == 0), "no tile has further lists");
            assert!(own[grid + 1..][..grid].iter().all(|count| *count == instants));
        }
    }
}

fn numbers(found: &FoundInstants) -> [usize; 2] {
    let words = found.words.as_ref().expect("the numbers were not read");
    [0, 1].map(|k| DeviceCount::of_words(&words[k].download::<f32>(client()).expect("the device works")))
}

fn down_i32(buffer: &gs_kernels::cube::buffer::Buffer) -> Vec<i32> {
    down_u32(buffer).into_iter().map(|value| value as i32).collect()
}

fn lists(found: &FoundInstants) -> Intersections {
    Intersections {
        tile_offsets: down_i32(&found.tile_offsets),
        gaussian_ids: down_i32(&found.gaussian_ids),
        gaussian_offsets: down_i32(&found.gaussian_offsets),
        positions: down_i32(&found.positions),
        places: down_i32(&found.places),
    }
}

#[test]
fn a_few_move() {
    Table::random(120, 400, 9, 5, 6.0, [150, 83]).check();
}

#[test]
fn all_move() {
    Table::random(121, 120, 1, 3, 9.0, [100, 64]).check();
}

#[test]
fn two_instants_and_many() {
    Table::random(122, 200, 7, 2, 20.0, [90, 50]).check();
    Table::random(123, 60, 5, 33, 0.7, [90, 50]).check();
}

/// More instants than a cube has units.
#[test]
fn three_hundred_instants() {
    Table::random(124, 30, 10, 300, 0.1, [50, 40]).check();
}

#[test]
fn equal_depths_keep_the_order_of_the_scene() {
    let mut table = Table::random(125, 300, 4, 4, 5.0, [80, 48]);
    for row in table.projected.chunks_mut(PROJECTED) {
        if row[7] > 0.0 {
            row[5] = 2.0;
        }
    }
    table.check();
}

/// A tile's list is longer than what a cube stages at once.
#[test]
fn long_lists() {
    let mut table = Table::random(126, 1500, 6, 3, 2.0, [40, 40]);
    for row in table.projected.chunks_mut(PROJECTED) {
        if row[7] > 0.0 {
            row[..2].iter_mut().for_each(|x| *x = x.clamp(10.0, 30.0));
        }
    }
    table.check();
}

#[test]
fn movers_that_are_nowhere() {
    let mut table = Table::random(127, 200, 5, 4, 4.0, [80, 48]);
    let scene = table.scene;
    for (k, row) in table.projected.chunks_mut(PROJECTED).enumerate().skip(scene) {
        match k % 4 {
            0 => row[0] = f32::NAN,
            1 => row[7] = 0.0,
            2 => row[1] = -1e6,
            _ => {}
        }
    }
    table.opacities[4] = f32::INFINITY;
    table.check();
}

#[test]
fn nothing_further() {
    // One instant: the lists of the image's tiles.
    let table = Table::random(128, 100, 6, 1, 0.0, [60, 40]);
    let (want, shares) = table.on_cpu();
    let found = table.found(None);
    assert_eq!(lists(&found), want);
    assert_eq!(down_i32(&found.shares), shares.numbers());
    // Nobody is seen.
    let mut table = Table::random(129, 40, 4, 3, 1.0, [60, 40]);
    table.projected.fill(0.0);
    let (want, shares) = table.on_cpu();
    let found = table.found(None);
    assert_eq!(lists(&found), want);
    assert_eq!(down_i32(&found.shares), shares.numbers());
}
