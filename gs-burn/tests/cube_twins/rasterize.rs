//! Blending, forward and backward. Both twins get one set of rows and lists, so that only blending is compared.

use gs_kernels::config::RasterizeConfig;
use gs_kernels::cpu;
use gs_kernels::cube::intersect::{Intersections, PAIRS_OF_A_UNIT};
use gs_kernels::cube::rasterize::{self, Inputs, RasterizeGradients};

use super::support::{Random, Scene, assert_gradient, client, down, up, up_u32, wide};

struct Case {
    config: RasterizeConfig,
    projected: Vec<f32>,
    opacities: Vec<f32>,
    features: Vec<f32>,
    background: Vec<f32>,
    lists: cpu::intersect::Intersections,
}

impl Case {
    fn new(scene: &Scene, channels: usize, depth: bool, seed: u64) -> Self {
        let mut random = Random(seed);
        let (width, height) = (scene.camera.width, scene.camera.height);
        let features = random.list(scene.count * channels, 0.0, 1.0);
        let projected = scene.projected();
        let lists = cpu::intersect::intersect(&projected, &scene.opacities, &features, width, height, channels);
        Self {
            config: RasterizeConfig { width, height, channels, depth },
            projected,
            opacities: scene.opacities.clone(),
            features,
            background: random.list(channels, 0.0, 1.0),
            lists,
        }
    }

    fn device_lists(&self) -> Intersections {
        let upload = |list: &[i32]| up_u32(&list.iter().map(|&v| v as u32).collect::<Vec<_>>());
        Intersections {
            tile_offsets: upload(&[&self.lists.tile_offsets[..], &self.lists.places].concat()),
            placed: self.lists.places.len(),
            gaussian_ids: upload(&self.lists.gaussian_ids),
            gaussian_offsets: upload(&self.lists.gaussian_offsets),
            positions: upload(&self.lists.positions),
        }
    }

    /// The inputs on the device.
    fn with<T>(&self, task: impl FnOnce(&Inputs) -> T) -> T {
        let lists = self.device_lists();
        let floats = [&self.projected, &self.opacities, &self.features, &self.background].map(|values| up(values));
        let [projected, opacities, features, background] = &floats;
        task(&Inputs { projected, opacities, features, background, lists: &lists })
    }

    fn forward(&self) -> Vec<f32> {
        let rendered = self.with(|inputs| rasterize::forward(client(), &self.config, inputs, false));
        down(&rendered.expect("forward").output)
    }

    fn backward(&self, v_output: &[f32]) -> RasterizeGradients {
        self.backward_within(v_output, rasterize::PAIR_BYTES)
    }

    fn backward_within(&self, v_output: &[f32], pair_bytes: usize) -> RasterizeGradients {
        let v = up(v_output);
        self.with(|inputs| {
            let saved = rasterize::forward(client(), &self.config, inputs, true).expect("forward").saved;
            let saved = saved.expect("was asked for");
            rasterize::backward_within(client(), &self.config, inputs, &saved, &v, true, pair_bytes)
        })
        .expect("backward")
    }

    fn judge_forward(&self) -> Vec<f64> {
        cpu::rasterize::forward(
            &self.config,
            &wide(&self.projected),
            &wide(&self.opacities),
            &wide(&self.features),
            &wide(&self.background),
            self.lists.as_slices(),
        )
    }

    fn judge_backward(&self, v_output: &[f32]) -> cpu::rasterize::RasterizeGradients<f64> {
        cpu::rasterize::backward(
            &self.config,
            &wide(&self.projected),
            &wide(&self.opacities),
            &wide(&self.features),
            &wide(&self.background),
            self.lists.as_slices(),
            &wide(v_output),
            None,
        )
    }

    /// Image within 1e-5 and gradients within `tolerance`; pixels where rounding moved a Gaussian across a cut-off are
    /// counted and take no part in the gradient.
    fn check(&self, seed: u64, tolerance: f64) {
        let stride = self.config.output_channels();
        let (got, want) = (self.forward(), self.judge_forward());
        assert_eq!(got.len(), want.len());
        let pixels = got.len() / stride;
        let mut moved = vec![false; pixels];
        let mut worst = 0.0f64;
        for pixel in 0..pixels {
            let range = pixel * stride..(pixel + 1) * stride;
            assert!(got[range.clone()].iter().all(|v| v.is_finite()));
            let differences = got[range.clone()].iter().zip(&want[range]);
            let error = differences.fold(0.0f64, |m, (&g, &w)| m.max((f64::from(g) - w).abs() / w.abs().max(1.0)));
            moved[pixel] = error > 1e-5;
            if moved[pixel] {
                assert!(error < 0.05, "pixel {pixel} is off by {error}");
            } else {
                worst = worst.max(error);
            }
        }
        let moved_count = moved.iter().filter(|&&moved| moved).count();
        println!(
            "{} pairs: image error {worst:.1e}, {moved_count} of {pixels} pixels at a cut-off",
            self.lists.gaussian_ids.len()
        );
        assert!(moved_count <= 1 + pixels / 500, "{moved_count} of {pixels} pixels differ");

        let mut v = Random(seed).list(got.len(), -1.0, 1.0);
        for pixel in (0..pixels).filter(|&pixel| moved[pixel]) {
            v[pixel * stride..(pixel + 1) * stride].fill(0.0);
        }
        let (got, want) = (self.backward(&v), self.judge_backward(&v));
        for column in 0..5 + usize::from(self.config.depth) {
            let take = |k: usize| k % 8 == column;
            let projected = down(&got.projected);
            let of = |all: &[f32]| -> Vec<f32> { (0..all.len()).filter(|&k| take(k)).map(|k| all[k]).collect() };
            let of_wide = |all: &[f64]| -> Vec<f64> { (0..all.len()).filter(|&k| take(k)).map(|k| all[k]).collect() };
            let name = ["mean x", "mean y", "d1", "l", "d2", "depth"][column];
            assert_gradient(name, &of(&projected), &of_wide(&want.projected), tolerance);
        }
        assert_gradient("opacities", &down(&got.opacities), &want.opacities, tolerance);
        assert_gradient("features", &down(&got.features), &want.features, tolerance);
        assert_gradient("background", &down(got.background.as_ref().expect("wanted")), &want.background, tolerance);
        assert_gradient("screen", &down(&got.screen), &want.screen, tolerance);
    }
}

#[test]
fn three_channels() {
    Case::new(&Scene::random(70, 250, 70, 45), 3, false, 1).check(2, 1e-3);
}

/// The first half of the Gaussians stand still, the others are there at three instants.
#[test]
fn tiles_of_several_instants() {
    for (depth, seed) in [(false, 31), (true, 32)] {
        let scene = Scene::random(seed, 240, 70, 45);
        let mut case = Case::new(&scene, 3, depth, seed + 10);
        // Rows 120.. are the movers at the first instant, then at two more.
        let moving: Vec<u32> = (80..120).collect();
        (case.projected, case.opacities, case.features) =
            (case.projected[..200 * 8].to_vec(), case.opacities[..200].to_vec(), case.features[..200 * 3].to_vec());
        let RasterizeConfig { width, height, .. } = case.config;
        let (lists, shares) = cpu::exposure::intersect_instants(
            &case.projected,
            &case.opacities,
            &case.features,
            width,
            height,
            3,
            120,
            &moving,
        );
        assert!(shares.tiles() > shares.grid());
        case.lists = lists;
        case.check(seed + 20, 1e-3);

        let v = Random(seed + 30).list(shares.tiles() * 256 * case.config.output_channels(), -1.0, 1.0);
        let (whole, part) = (case.backward(&v), case.backward_within(&v, 100 * 4 * 12));
        assert_eq!(down(&whole.projected), down(&part.projected), "little memory");
        assert_eq!(
            down(whole.background.as_ref().expect("wanted")),
            down(part.background.as_ref().expect("wanted")),
            "little memory"
        );
    }
}

#[test]
fn depth_is_one_more_channel() {
    Case::new(&Scene::random(71, 200, 48, 64), 3, true, 3).check(4, 1e-3);
}

#[test]
fn one_channel_and_many() {
    Case::new(&Scene::random(72, 120, 33, 20), 1, false, 5).check(6, 1e-3);
    Case::new(&Scene::random(73, 120, 33, 20), 8, true, 7).check(8, 1e-3);
    Case::new(&Scene::random(74, 120, 33, 20), 32, true, 9).check(10, 1e-3);
}

#[test]
fn more_channels_than_meet_at_once() {
    Case::new(&Scene::random(75, 60, 20, 17), 61, false, 11).check(12, 1e-3);
}

#[test]
fn opaque_stack() {
    let mut scene = Scene::random(76, 200, 32, 32);
    scene.log_scales.fill(0.5);
    scene.opacities.iter_mut().enumerate().for_each(|(k, o)| *o = [0.99, 0.999, 1.0, 0.02][k % 4]);
    Case::new(&scene, 3, false, 13).check(14, 1e-2);
}

#[test]
fn long_lists() {
    // Faint and wide: every tile walks over many batches, and no pixel ends early.
    let mut scene = Scene::random(77, 500, 34, 18);
    scene.log_scales.fill(-0.5);
    scene.opacities.fill(0.008);
    Case::new(&scene, 3, false, 15).check(16, 1e-3);
}

/// Gaussians over all 130 tiles have chunks of pairs of their own, in any number of ranges of tiles.
#[test]
fn over_all_tiles() {
    let mut scene = Scene::random(84, 60, 200, 150);
    scene.log_scales[..9].fill(2.0);
    scene.opacities[..3].fill(0.05);
    let case = Case::new(&scene, 3, false, 27);
    let most = case.lists.gaussian_offsets.windows(2).map(|pair| pair[1] - pair[0]).max();
    assert!(most >= Some(2 * rasterize::CHUNK as i32), "{most:?} pairs of one Gaussian");
    case.check(28, 1e-3);
    let v = Random(29).list(200 * 150 * 4, -1.0, 1.0);
    let (whole, part) = (case.backward(&v), case.backward_within(&v, 300 * 4 * 11));
    assert_eq!(down(&whole.projected), down(&part.projected), "little memory");
    assert_eq!(down(&whole.features), down(&part.features), "little memory");
}

/// No unit that adds pairs, and none that emits them, does much more than the others, however many tiles a Gaussian
/// has.
#[test]
fn long_lists_are_shared_among_units() {
    let chunk = rasterize::CHUNK;
    // None to all tiles of an image of 3840 x 2160.
    for pairs in [0, 1, chunk - 1, chunk, 2 * chunk - 1, 200, 8_160, 32_400] {
        let most = (0..2 * chunk).map(|begin| rasterize::added_by_a_unit(begin, begin + pairs)).max();
        assert!(most <= Some(2 * chunk - 2 + pairs / chunk), "{pairs} pairs: {most:?} additions");
    }
    // At 1920 x 1080, no more than twice what a Gaussian of a hundred pairs costs that meets no whole chunk.
    assert!(rasterize::added_by_a_unit(0, 8_160) <= 2 * 100);
    let units = 8_160u32.div_ceil(PAIRS_OF_A_UNIT);
    assert!(units >= 500, "a Gaussian over all tiles is emitted by {units} units");
}

#[test]
fn needles() {
    let mut scene = Scene::random(83, 150, 50, 50);
    for scales in scene.log_scales.chunks_mut(3) {
        scales.copy_from_slice(&[0.0, -7.0, -7.0]);
    }
    Case::new(&scene, 3, false, 25).check(26, 1e-2);
}

#[test]
fn one_pixel() {
    Case::new(&Scene::random(78, 40, 1, 1), 3, false, 17).check(18, 1e-3);
}

#[test]
fn equal_inputs_give_equal_bits() {
    let case = Case::new(&Scene::random(79, 200, 50, 50), 3, false, 19);
    let v = Random(20).list(50 * 50 * 4, -1.0, 1.0);
    let (first, second) = (case.backward(&v), case.backward(&v));
    assert_eq!(case.forward(), case.forward());
    assert_eq!(down(&first.projected), down(&second.projected));
    assert_eq!(down(&first.features), down(&second.features));
    assert_eq!(down(first.background.as_ref().expect("wanted")), down(second.background.as_ref().expect("wanted")));
}

#[test]
fn little_memory_gives_the_same_bits() {
    let case = Case::new(&Scene::random(82, 300, 70, 50), 3, true, 23);
    let v = Random(24).list(70 * 50 * 5, -1.0, 1.0);
    let whole = case.backward(&v);
    for pairs in [1, 40, 200] {
        let part = case.backward_within(&v, pairs * 4 * 12);
        assert_eq!(down(&whole.projected), down(&part.projected), "{pairs} pairs at once");
        assert_eq!(down(&whole.features), down(&part.features));
        assert_eq!(down(whole.background.as_ref().expect("wanted")), down(part.background.as_ref().expect("wanted")));
    }
}

#[test]
fn nobody_in_the_image() {
    let mut case = Case::new(&Scene::random(80, 0, 40, 24), 3, true, 21);
    let image = case.forward();
    for pixel in image.chunks(5) {
        assert_eq!(pixel, [case.background[0], case.background[1], case.background[2], 0.0, 0.0]);
    }
    let v = vec![0.5; image.len()];
    let got = case.backward(&v);
    assert_eq!(down(got.background.as_ref().expect("wanted")), [480.0; 3]);
    case.background[1] = f32::NAN;
    assert!(case.forward().iter().all(|v| v.is_finite()));
}

#[test]
fn not_finite_gradients_become_zero() {
    let case = Case::new(&Scene::random(81, 100, 40, 40), 3, false, 22);
    let mut v = vec![0.5; 40 * 40 * 4];
    v[4 * 820] = f32::NAN;
    v[4 * 30 + 1] = f32::INFINITY;
    let got = case.backward(&v);
    for gradient in [down(&got.projected), down(&got.opacities), down(&got.features), down(&got.screen)] {
        assert!(gradient.iter().all(|v| v.is_finite()));
        assert!(gradient.iter().any(|&v| v != 0.0));
    }
    assert_eq!(down(got.background.as_ref().expect("wanted")), [0.0; 3]);
}
