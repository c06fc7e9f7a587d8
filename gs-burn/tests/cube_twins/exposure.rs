//! Several instants in one image: the mean of tiles by itself, and the whole path through Burn on both devices.

use burn::tensor::{Device, Tensor};
use gs_burn::{ExposureOptions, MovingSample, RenderOptions, device, render, render_exposure};
use gs_kernels::config::AverageConfig;
use gs_kernels::cpu::exposure as cpu;
use gs_kernels::cpu::exposure::TileShares;
use gs_kernels::cube::exposure as cube;

use crate::render::{gpu, values};
use crate::support::{Random, Scene, assert_gradient, assert_values, client, data, down, up, wide};

const WIDTH: usize = 70;
const HEIGHT: usize = 45;

#[test]
fn mean_of_tiles() {
    // A grid of 3 x 2 tiles; the second tile has two more, the last one one more.
    let shares =
        TileShares { instants: 4, extra_offsets: vec![0, 0, 2, 2, 2, 2, 3], counts: vec![4, 1, 4, 4, 4, 3, 2, 1, 1] };
    for (encoded, shares) in [(0, &shares), (3, &shares), (3, &TileShares::first_only(6, 9))] {
        let config = AverageConfig { width: 41, height: 20, channels: 5, encoded };
        let mut random = Random(7);
        let mut tiles = random.list(9 * 256 * 5, 0.0, 1.2);
        // On the line near black too, and below it.
        tiles.iter_mut().step_by(7).for_each(|x| *x = 0.05 * *x - 0.01);
        let image = down(&cube::average(client(), &config, shares, &up(&tiles)).expect("forward"));
        // Powers on a GPU are exponentials of products of logarithms, right to some units in the last place.
        assert_values("image", &image, &cpu::average(&config, shares, &wide(&tiles)), 2e-6);
        let v = random.list(image.len(), -1.0, 1.0);
        let v_tiles = cube::average_backward(client(), &config, shares, &up(&tiles), &up(&v)).expect("backward");
        let want = cpu::average_backward(&config, shares, &wide(&tiles), &wide(&v));
        assert_gradient("tiles", &down(&v_tiles), &want, 1e-4);
    }
}

struct Trial {
    image: Vec<f32>,
    middle: Vec<f32>,
    single: Vec<f32>,
    counts: [usize; 3],
    gradients: Vec<(String, Vec<f32>)>,
}

/// Every `every`th of the scene's Gaussians moves, at `instants` instants.
fn trial(device: &Device, scene: &Scene, every: usize, instants: usize) -> Trial {
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
    let options = ExposureOptions { render: render_options, linear: true };
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
    let counts = [rendering.tiles, rendering.full_tiles, rendering.intersections.get()];
    let middle = values(rendering.middle().color);
    // The scene itself is the second instant.
    let single = values(render(&gaussians, &camera, &render_options).color);
    Trial { image: values(image), middle, single, counts, gradients: all }
}

#[test]
fn same_exposure_on_both_devices() {
    let scene = Scene::random(94, 150, WIDTH as u32, HEIGHT as u32);
    let want = trial(&device::select("flex").expect("flex is built").autodiff(), &scene, 8, 3);
    let got = trial(&gpu(), &scene, 8, 3);
    println!("[tiles, full, pairs] {:?}", got.counts);
    assert_eq!(got.counts, want.counts);
    assert_values("image", &got.image, &wide(&want.image), 1e-5);
    for ((name, got), (_, want)) in got.gradients.iter().zip(&want.gradients) {
        assert_gradient(name, got, &wide(want), 1e-3);
    }
    // The lists are made on the host; each tile's pixels must still be those of a rendering whose lists are not.
    assert_eq!(got.middle, got.single);
    assert_eq!(want.middle, want.single);
}

#[test]
fn nothing_moves_and_nothing_is_there() {
    let scene = Scene::random(95, 20, WIDTH as u32, HEIGHT as u32);
    let mut got = trial(&gpu(), &scene, 20, 1);
    assert_eq!(got.counts[0], got.counts[1]);
    assert!(got.image.iter().all(|x| x.is_finite()));
    got.gradients.retain(|(_, gradient)| gradient.iter().any(|x| *x != 0.0));
    assert_eq!(got.gradients.len(), 9, "every gradient is there");
}
