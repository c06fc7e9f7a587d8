//! Several instants in one image: the mean of tiles by itself, and the whole path through Burn on both devices.

use burn::tensor::{Device, Tensor};
use gs_burn::ops::intersect::Room;
use gs_burn::{ExposureOptions, MovingSample, RenderOptions, device, render, render_exposure};
use gs_kernels::config::AverageConfig;
use gs_kernels::cpu::exposure as cpu;
use gs_kernels::cpu::exposure::TileShares;
use gs_kernels::cube::exposure as cube;

use super::render::{gpu, values};
use super::support::{Random, Scene, assert_gradient, assert_values, client, data, down, up, up_u32, wide};

const WIDTH: usize = 70;
const HEIGHT: usize = 45;

#[test]
fn mean_of_tiles() {
    // A grid of 3 x 2 tiles; the second tile has two more, the last one one more.
    let shares =
        TileShares { instants: 4, extra_offsets: vec![0, 0, 2, 2, 2, 2, 3], counts: vec![4, 1, 4, 4, 4, 3, 2, 1, 1] };
    let upload = |shares: &TileShares| up_u32(&shares.numbers().iter().map(|x| *x as u32).collect::<Vec<_>>());
    for (encoded, shares) in [(0, &shares), (3, &shares), (3, &TileShares::first_only(6, 9))] {
        let (numbers, instants) = (upload(shares), shares.instants);
        let config = AverageConfig { width: 41, height: 20, channels: 5, encoded };
        let mut random = Random(7);
        let mut tiles = random.list(9 * 256 * 5, 0.0, 1.2);
        // On the line near black too, and below it.
        tiles.iter_mut().step_by(7).for_each(|x| *x = 0.05 * *x - 0.01);
        let image = down(&cube::average(client(), &config, &numbers, instants, &up(&tiles)).expect("forward"));
        // Powers on a GPU are exponentials of products of logarithms, right to some units in the last place.
        assert_values("image", &image, &cpu::average(&config, shares, &wide(&tiles)), 2e-6);
        let v = random.list(image.len(), -1.0, 1.0);
        let (values, v_image) = (up(&tiles), up(&v));
        let v_tiles =
            cube::average_backward(client(), &config, &numbers, instants, &values, &v_image).expect("backward");
        let want = cpu::average_backward(&config, shares, &wide(&tiles), &wide(&v));
        assert_gradient("tiles", &down(&v_tiles), &want, 1e-4);
    }
}

struct Trial {
    image: Vec<f32>,
    middle: Vec<f32>,
    single: Vec<f32>,
    counts: [usize; 3],
    overflows: bool,
    gradients: Vec<(String, Vec<f32>)>,
}

/// Every `every`th of the scene's Gaussians moves, at `instants` instants; a GPU has `room` for lists.
fn trial(device: &Device, scene: &Scene, every: usize, instants: usize, room: Option<Room>) -> Trial {
    let count = scene.count;
    let mut random = Random(93);
    let gaussians = scene.gaussians(&mut random, device);
    let moving: Vec<u32> = (0..count as u32).filter(|row| *row as usize % every == every - 1).collect();
    let movers = moving.len();
    let (velocities, turns) = (random.list(3 * movers, -0.05, 0.05), random.list(4 * movers, -0.05, 0.05));
    let samples: Vec<MovingSample> = (0..instants)
        .map(|k| {
            let at = |columns: usize, start: &[f32], change: &[f32]| -> Vec<f32> {
                let rows = moving.iter().flat_map(|&row| &start[row as usize * columns..][..columns]);
                rows.zip(change).map(|(x, v)| x + (k as f32 - 1.0) * v).collect()
            };
            let (means, quats) = (at(3, &scene.means, &velocities), at(4, &scene.quats, &turns));
            MovingSample {
                means: Tensor::from_data(data(&means, &[movers, 3]), device).require_grad(),
                quats: Tensor::from_data(data(&quats, &[movers, 4]), device).require_grad(),
            }
        })
        .collect();
    let camera = scene.posed_camera(device);
    let screen = Tensor::<2>::zeros([count, 4], device).require_grad();
    let render_options = RenderOptions { background: [0.2, 0.4, 0.6], depth: true, ..Default::default() };
    let options = ExposureOptions { render: render_options, linear: true, room };
    let rendering = render_exposure(&gaussians, &moving, &samples, &camera, &options, Some(screen.clone()));
    let depth = rendering.depth.clone().expect("depth was asked for");
    let image = Tensor::cat(vec![rendering.color.clone(), rendering.alpha.clone(), depth], 2);
    let weights = Tensor::from_data(data(&random.list(WIDTH * HEIGHT * 5, -1.0, 1.0), &[HEIGHT, WIDTH, 5]), device);
    let gradients = (image.clone() * weights).mean().backward();
    let of = "every parameter has a gradient";
    let mut all = vec![
        ("means".to_owned(), values(gaussians.means.grad(&gradients).expect(of))),
        ("quats".to_owned(), values(gaussians.quats.grad(&gradients).expect(of))),
        ("log_scales".to_owned(), values(gaussians.log_scales.grad(&gradients).expect(of))),
        ("opacity_logits".to_owned(), values(gaussians.opacity_logits.grad(&gradients).expect(of))),
        ("sh".to_owned(), values(gaussians.sh.grad(&gradients).expect(of))),
        ("viewmat".to_owned(), values(camera.viewmat.grad(&gradients).expect(of))),
        ("screen".to_owned(), values(screen.grad(&gradients).expect(of))),
    ];
    for (k, sample) in samples.iter().enumerate() {
        all.push((format!("means of sample {k}"), values(sample.means.grad(&gradients).expect(of))));
        all.push((format!("quats of sample {k}"), values(sample.quats.grad(&gradients).expect(of))));
    }
    let counts = [rendering.tiles.get(), rendering.full_tiles, rendering.intersections.get()];
    let overflows = rendering.tiles.overflows(counts[0]) || rendering.intersections.overflows(counts[2]);
    let middle = values(rendering.middle().color);
    // The scene itself is the second instant.
    let single = values(render(&gaussians, &camera, &render_options).color);
    Trial { image: values(image), middle, single, counts, overflows, gradients: all }
}

#[test]
fn same_exposure_on_both_devices() {
    let scene = Scene::random(94, 150, WIDTH as u32, HEIGHT as u32);
    let want = trial(&device::select("flex").expect("flex is built").autodiff(), &scene, 8, 3, None);
    let got = trial(&gpu(), &scene, 8, 3, None);
    println!("[tiles, full, pairs] {:?}", got.counts);
    assert_eq!(got.counts, want.counts);
    assert_values("image", &got.image, &wide(&want.image), 1e-5);
    for ((name, got), (_, want)) in got.gradients.iter().zip(&want.gradients) {
        assert_gradient(name, got, &wide(want), 1e-3);
    }
    // Each tile's pixels are those of a rendering of one instant.
    assert_eq!(got.middle, got.single);
    assert_eq!(want.middle, want.single);
}

#[test]
fn room_changes_no_bit_and_too_little_tells() {
    let scene = Scene::random(94, 150, WIDTH as u32, HEIGHT as u32);
    let counted = trial(&gpu(), &scene, 8, 3, None);
    let [tiles, _, pairs] = counted.counts;
    for room in [Room { pairs, tiles }, Room { pairs: pairs + 1, tiles: tiles + 1 }, Room { pairs: 9000, tiles: 200 }] {
        let within = trial(&gpu(), &scene, 8, 3, Some(room));
        assert_eq!(within.counts, counted.counts);
        assert!(!within.overflows);
        assert!(within.image == counted.image && within.middle == counted.middle, "{room:?}");
        for ((name, got), (_, want)) in within.gradients.iter().zip(&counted.gradients) {
            assert_eq!(got, want, "{name} with {room:?}");
        }
    }
    // Room that no buffer holds is not used.
    let counting = trial(&gpu(), &scene, 8, 3, Some(Room { pairs, tiles: usize::MAX / 2 }));
    assert_eq!((counting.counts, &counting.image), (counted.counts, &counted.image));
    for room in [Room { pairs: pairs - 1, tiles }, Room { pairs, tiles: tiles - 1 }, Room { pairs: 100, tiles: 1 }] {
        let within = trial(&gpu(), &scene, 8, 3, Some(room));
        assert!(within.overflows, "{room:?}");
        // The background alone, no opacity, no depth.
        let background = [0.2, 0.4, 0.6, 0.0, 0.0];
        let near = |(x, y): (&f32, &f32)| (x - y).abs() < 1e-6;
        assert!(within.image.chunks(5).all(|pixel| pixel.iter().zip(&background).all(near)), "{room:?}");
    }
}

#[test]
fn nothing_moves_and_nothing_is_there() {
    let scene = Scene::random(95, 20, WIDTH as u32, HEIGHT as u32);
    let mut got = trial(&gpu(), &scene, 20, 1, None);
    assert_eq!(got.counts[0], got.counts[1]);
    assert!(got.image.iter().all(|x| x.is_finite()));
    let within = trial(&gpu(), &scene, 20, 1, Some(Room { pairs: got.counts[2] + 5, tiles: 1 }));
    assert_eq!((&within.image, within.counts), (&got.image, got.counts));
    got.gradients.retain(|(_, gradient)| gradient.iter().any(|x| *x != 0.0));
    assert_eq!(got.gradients.len(), 9, "every gradient is there");
}
