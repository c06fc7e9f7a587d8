//! Several instants of a scene at once against each of them alone.

use crate::scenes::{Random, Scene};
use gs_kernels::config::{AverageConfig, RasterizeConfig, ShConfig};
use gs_kernels::constants::TILE;
use gs_kernels::cpu::exposure::{TileShares, average, average_backward, intersect_instants};
use gs_kernels::cpu::intersect::Intersections;
use gs_kernels::cpu::light::{to_encoded, to_linear};
use gs_kernels::cpu::{Real, intersect, rasterize, sh};
use gs_kernels::rows::PROJECTED;

const SH: ShConfig = ShConfig { degree: 3, coefficients: 16 };
const BACKGROUND: [f64; 3] = [0.2, 0.4, 0.6];

/// Projected rows, opacities and colours of one scene, or of a table of rows.
#[derive(Clone)]
struct Rows<F> {
    projected: Vec<F>,
    opacities: Vec<F>,
    colors: Vec<F>,
}

impl<F: Real> Rows<F> {
    fn of(scene: &Scene<F>) -> Self {
        let projected = scene.project();
        let colors = sh::forward(&scene.means, &scene.sh, &scene.viewmat, &projected, &SH);
        Self { projected, opacities: scene.opacities(), colors }
    }

    fn push(&mut self, from: &Self, row: usize) {
        self.projected.extend(&from.projected[row * PROJECTED..][..PROJECTED]);
        self.opacities.push(from.opacities[row]);
        self.colors.extend(&from.colors[3 * row..][..3]);
    }

    fn draw(&self, config: &RasterizeConfig, lists: &Intersections) -> Vec<F> {
        let background = BACKGROUND.map(F::of);
        rasterize::forward(config, &self.projected, &self.opacities, &self.colors, &background, lists.as_slices())
    }
}

struct Case<F> {
    config: RasterizeConfig,
    /// Each instant alone.
    instants: Vec<Rows<F>>,
    table: Rows<F>,
    lists: Intersections,
    shares: TileShares,
}

impl<F: Real> Case<F> {
    /// `count` Gaussians of which every `every`th moves, at `instants` instants; small, so that tiles differ in what
    /// touches them. Two of them share one depth.
    fn new(count: usize, every: usize, instants: usize, step: f64) -> Self {
        let mut scene = Scene::<f64>::random(count, 17);
        scene.config.width = 120;
        scene.config.height = 83;
        scene.config.fx *= 2.0;
        scene.config.fy *= 2.0;
        scene.config.cx = 57.0;
        scene.config.cy = 42.0;
        scene.log_scales.iter_mut().for_each(|s| *s -= 1.0);
        let moving: Vec<u32> = (0..count as u32).filter(|i| *i as usize % every == every - 1).collect();
        let mut random = Random::new(5);
        let velocity: Vec<f64> = random.values(3 * count, -step, step);
        let at = |k: usize| {
            let mut scene = scene.clone();
            for &row in &moving {
                for axis in 0..3 {
                    scene.means[3 * row as usize + axis] += k as f64 * velocity[3 * row as usize + axis];
                }
            }
            Rows::of(&scene.cast::<F>())
        };
        let all: Vec<Rows<F>> = (0..instants).map(at).collect();
        let mut table = all[0].clone();
        for rows in &all[1..] {
            moving.iter().for_each(|&row| table.push(rows, row as usize));
        }
        let config =
            RasterizeConfig { width: scene.config.width, height: scene.config.height, channels: 3, depth: true };
        let (lists, shares) = intersect_instants(
            &table.projected,
            &table.opacities,
            &table.colors,
            config.width,
            config.height,
            3,
            count,
            &moving,
        );
        Self { config, instants: all, table, lists, shares }
    }

    fn average_config(&self, encoded: usize) -> AverageConfig {
        AverageConfig { width: self.config.width, height: self.config.height, channels: 5, encoded }
    }

    fn alone(&self) -> Vec<Vec<F>> {
        let RasterizeConfig { width, height, .. } = self.config;
        let draw = |rows: &Rows<F>| {
            let lists = intersect::intersect(&rows.projected, &rows.opacities, &rows.colors, width, height, 3);
            rows.draw(&self.config, &lists)
        };
        self.instants.iter().map(draw).collect()
    }

    /// Extra tiles of a tile of the image.
    fn extras(&self, tile: usize) -> std::ops::Range<usize> {
        let grid = self.shares.grid();
        grid + self.shares.extra_offsets[tile] as usize..grid + self.shares.extra_offsets[tile + 1] as usize
    }
}

/// Pixels of tile `tile` of an image, those outside it left out: place in the image and in a drawn tile.
fn pixels(config: &RasterizeConfig, tile: usize) -> impl Iterator<Item = (usize, usize)> {
    let (width, height) = (config.width as usize, config.height as usize);
    let columns = config.tiles().0;
    let [x, y] = [tile % columns * TILE, tile / columns * TILE];
    (0..TILE * TILE)
        .filter(move |k| x + k % TILE < width && y + k / TILE < height)
        .map(move |k| ((y + k / TILE) * width + x + k % TILE, k))
}

/// Every instant's pixel is one of those drawn for its tile, and for each drawn tile as many instants show it as it
/// counts.
fn check_tiles<F: Real>(case: &Case<F>) {
    let (drawn, alone) = (case.table.draw(&case.config, &case.lists), case.alone());
    for tile in 0..case.shares.grid() {
        let showing = |v: usize, image: &[F]| {
            pixels(&case.config, tile)
                .all(|(pixel, k)| drawn[(v * TILE * TILE + k) * 5..][..5] == image[pixel * 5..][..5])
        };
        let mut counts = 0;
        for v in std::iter::once(tile).chain(case.extras(tile)) {
            let instants = alone.iter().filter(|image| showing(v, image)).count();
            assert!(
                instants >= case.shares.counts[v] as usize,
                "tile {tile}: drawn tile {v} is shown {instants} times"
            );
            counts += case.shares.counts[v] as usize;
        }
        assert_eq!(counts, case.shares.instants, "tile {tile}: every instant is counted once");
        assert!(alone.iter().all(|image| std::iter::once(tile).chain(case.extras(tile)).any(|v| showing(v, image))));
    }
}

#[test]
fn tiles_are_those_of_each_instant_to_the_bit() {
    for (count, every, instants, step) in
        [(300, 7, 5, 0.05), (300, 60, 3, 0.4), (60, 1, 4, 0.1), (40, 41, 3, 0.1), (30, 3, 1, 0.1), (0, 1, 1, 0.1)]
    {
        check_tiles(&Case::<f32>::new(count, every, instants, step));
        check_tiles(&Case::<f64>::new(count, every, instants, step));
    }
}

#[test]
fn few_movers_leave_most_tiles_alone() {
    let case = Case::<f32>::new(300, 100, 6, 0.02);
    let (grid, tiles) = (case.shares.grid(), case.shares.tiles());
    assert!(tiles > grid && tiles < 3 * grid, "{tiles} tiles drawn for a grid of {grid} at 6 instants");
    let untouched = (0..grid).filter(|&tile| case.extras(tile).is_empty()).count();
    assert!(untouched > grid / 2, "{untouched} of {grid} tiles are drawn once");
}

#[test]
fn lists_agree_with_each_other() {
    let Case { lists, shares, table, .. } = Case::<f32>::new(300, 7, 5, 0.05);
    assert_eq!(lists.places.len(), shares.tiles());
    assert_eq!(lists.tile_offsets.len(), shares.tiles() + 1);
    assert_eq!(lists.gaussian_offsets.len(), table.opacities.len() + 1);
    for row in 0..table.opacities.len() {
        let own = &lists.positions[lists.gaussian_offsets[row] as usize..lists.gaussian_offsets[row + 1] as usize];
        assert!(own.is_sorted_by(|a, b| a < b));
        assert!(own.iter().all(|&position| lists.gaussian_ids[position as usize] == row as i32));
    }
    assert_eq!(*lists.gaussian_offsets.last().unwrap() as usize, lists.gaussian_ids.len());
}

#[test]
fn equal_depths_keep_the_scene_s_order() {
    let mut scene = Scene::<f64>::random(6, 3);
    for k in 0..6 {
        scene.means[3 * k..3 * k + 3].copy_from_slice(&[0.0, 0.0, 3.0]);
    }
    let rows = Rows::of(&scene);
    let mut table = rows.clone();
    [1, 4].into_iter().for_each(|row| table.push(&rows, row));
    let (lists, _) = intersect_instants(&table.projected, &table.opacities, &table.colors, 53, 37, 3, 6, &[1, 4]);
    let grid = RasterizeConfig { width: 53, height: 37, channels: 3, depth: false }.tiles();
    let last = |tile: usize| {
        lists.gaussian_ids[lists.tile_offsets[tile] as usize..lists.tile_offsets[tile + 1] as usize].to_vec()
    };
    let mut seen = 0;
    for tile in grid.0 * grid.1..lists.places.len() {
        let numbers: Vec<i32> =
            last(tile).iter().map(|&row| if row < 6 { row } else { [1, 4][row as usize - 6] }).collect();
        assert!(numbers.is_sorted_by(|a, b| a < b), "{numbers:?}");
        seen += usize::from(numbers.len() > 3);
    }
    assert!(seen > 0, "the scene must make lists that tell");
}

#[test]
fn mean_of_the_instants() {
    for encoded in [0, 3] {
        let case = Case::<f64>::new(300, 7, 5, 0.05);
        let drawn = case.table.draw(&case.config, &case.lists);
        let image = average(&case.average_config(encoded), &case.shares, &drawn);
        let alone = case.alone();
        for (k, &value) in image.iter().enumerate() {
            let light = k % 5 < encoded;
            let sum: f64 = alone.iter().map(|image| if light { to_linear(image[k]) } else { image[k] }).sum();
            let mean = sum / alone.len() as f64;
            let want = if light { to_encoded(mean) } else { mean };
            // Rounding, and where one drawn tile is all there is the standard's knees (3e-8), see `cpu::light`.
            assert!((value - want).abs() < 1e-7, "value {k}: {value} instead of {want}");
        }
    }
}

#[test]
fn first_only_is_the_first_instant() {
    let case = Case::<f32>::new(300, 7, 5, 0.05);
    let drawn = case.table.draw(&case.config, &case.lists);
    let shares = TileShares::first_only(case.shares.grid(), case.shares.tiles());
    assert_eq!(average(&case.average_config(3), &shares, &drawn), case.alone()[0]);
}

/// Each drawn value's gradient against a central difference of a weighting of the image.
#[test]
fn average_backward_is_the_derivative() {
    let case = Case::<f64>::new(120, 5, 4, 0.1);
    let config = case.average_config(3);
    let mut drawn = case.table.draw(&case.config, &case.lists);
    let count = average(&config, &case.shares, &drawn).len();
    let weights: Vec<f64> = Random::new(8).values(count, -1.0, 1.0);
    let gradient = average_backward(&config, &case.shares, &drawn, &weights);
    let weigh = |drawn: &[f64]| -> f64 {
        average(&config, &case.shares, drawn).iter().zip(&weights).map(|(value, weight)| value * weight).sum()
    };
    let (h, mut met) = (1e-5, 0);
    for at in (0..drawn.len()).step_by((drawn.len() / 400) | 1) {
        let value = drawn[at];
        drawn[at] = value + h;
        let up = weigh(&drawn);
        drawn[at] = value - h;
        let down = weigh(&drawn);
        drawn[at] = value;
        let want = (up - down) / (2.0 * h);
        // The sum of 50,000 values carries 1e-12, over the step 1e-7.
        assert!((gradient[at] - want).abs() < 1e-6, "{at}: {} instead of {want}", gradient[at]);
        met += usize::from(gradient[at] != 0.0);
    }
    assert!(met > 200, "only {met} gradients are not zero");
}

/// The rasterizer's backward over drawn tiles is the sum over the instants of its backward alone.
#[test]
fn gradients_are_the_sum_over_instants() {
    let (count, every) = (200, 5);
    let case = Case::<f64>::new(count, every, 4, 0.1);
    let RasterizeConfig { width, height, .. } = case.config;
    let background = BACKGROUND;
    let values = width as usize * height as usize * 5;
    let v_image: Vec<f64> = Random::new(4).values(values, -1.0, 1.0);
    let instants = case.instants.len() as f64;

    let Rows { projected, opacities, colors } = &case.table;
    let drawn = case.table.draw(&case.config, &case.lists);
    let v_tiles = average_backward(&case.average_config(0), &case.shares, &drawn, &v_image);
    let lists = case.lists.as_slices();
    let got = rasterize::backward(&case.config, projected, opacities, colors, &background, lists, &v_tiles, None);

    let moving: Vec<usize> = (0..count).filter(|i| i % every == every - 1).collect();
    let mut want = [vec![0.0; projected.len()], vec![0.0; opacities.len()], vec![0.0; colors.len()]];
    let mut screen = vec![0.0; opacities.len() * 4];
    let mut v_background = [0.0; 3];
    for (k, rows) in case.instants.iter().enumerate() {
        let lists = intersect::intersect(&rows.projected, &rows.opacities, &rows.colors, width, height, 3);
        let lists = lists.as_slices();
        let v: Vec<f64> = v_image.iter().map(|v| v / instants).collect();
        let Rows { projected, opacities, colors } = rows;
        let g = rasterize::backward(&case.config, projected, opacities, colors, &background, lists, &v, None);
        for row in 0..count {
            let to = match moving.binary_search(&row) {
                Ok(m) if k > 0 => count + (k - 1) * moving.len() + m,
                _ => row,
            };
            (0..8).for_each(|c| want[0][8 * to + c] += g.projected[8 * row + c]);
            want[1][to] += g.opacities[row];
            (0..3).for_each(|c| want[2][3 * to + c] += g.features[3 * row + c]);
            (0..4).for_each(|c| screen[4 * to + c] += g.screen[4 * row + c]);
        }
        (0..3).for_each(|c| v_background[c] += g.background[c]);
    }
    // Only the order of sums differs.
    let close = |name: &str, got: &[f64], want: &[f64]| {
        let scale = want.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        let worst = got.iter().zip(want).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(scale > 0.0 && worst <= 1e-12 * scale, "{name}: off by {worst:.1e} of {scale:.1e}");
    };
    close("projected", &got.projected, &want[0]);
    close("opacities", &got.opacities, &want[1]);
    close("colors", &got.features, &want[2]);
    close("screen", &got.screen, &screen);
    close("background", &got.background, &v_background);
}
