//! CPU time of an exposure against as many renderings, forward and backward; `cargo bench -p gs-tests --bench exposure`.
//!
//! 10,000 Gaussians at 256 x 192, of which 1,000 move by a few pixels in the middle of the image. The mean over the
//! instants is that of light in the exposure; the renderings are averaged as they are, which costs them less.
//! `GS_BENCH_DEVICE` names the device, as for the other benchmarks; the times say something on a CPU only.
#![recursion_limit = "256"]

mod workloads;

use burn::tensor::{Device, Tensor, TensorData};
use gs_base::Intrinsics;
use gs_burn::{Camera, ExposureOptions, Gaussians, MovingSample, render, render_exposure};

use workloads::clock::cpu_seconds;
use workloads::generator::{self, Random};

const COUNT: usize = 10_000;
const MOVERS: usize = 1_000;
const SIZE: [usize; 2] = [256, 192];
/// Pixels in which the movers' centres lie at first, and how far they come.
const BLOCK: [[f64; 2]; 2] = [[104.0, 144.0], [84.0, 108.0]];
const WAY: f64 = 4.0;

fn main() {
    let device = workloads::bench_device();
    let world = World::new(&device);
    println!(
        "instants  tiles      of  touched  exposure ms  renderings ms  ratio  backward too: exposure ms  renderings ms  ratio"
    );
    for instants in [1, 3, 7, 15, 33] {
        let samples = world.samples(instants);
        let rendering = world.exposure(&samples);
        let tiles = rendering.tiles.get();
        let touched = tiles - rendering.full_tiles / instants;
        let grid = rendering.full_tiles / instants;
        let [shared, alone] =
            [true, false].map(|shared| [false, true].map(|back| best(|| world.step(&samples, shared, back))));
        println!(
            "{instants:>8}  {:>5}  {:>6}  {:>6.1}%  {:>11.1}  {:>13.1}  {:>5.2}  {:>26.1}  {:>13.1}  {:>5.2}",
            tiles,
            rendering.full_tiles,
            100.0 * touched as f64 / (instants.max(2) - 1) as f64 / grid as f64,
            1e3 * shared[0],
            1e3 * alone[0],
            shared[0] / alone[0],
            1e3 * shared[1],
            1e3 * alone[1],
            shared[1] / alone[1],
        );
    }
}

/// Least CPU seconds of a few runs.
fn best(run: impl Fn()) -> f64 {
    let seconds = |_| {
        let start = cpu_seconds();
        run();
        cpu_seconds() - start
    };
    (0..7).map(seconds).fold(f64::MAX, f64::min)
}

struct World {
    gaussians: Gaussians,
    camera: Camera,
    moving: Vec<u32>,
    /// Centres and orientations of the movers at first, and by how much they change over the exposure.
    start: [Vec<f32>; 2],
    change: [Vec<f32>; 2],
    device: Device,
}

fn tensor<const D: usize>(values: Vec<f32>, shape: [usize; D], device: &Device) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values, shape), device)
}

impl World {
    fn new(device: &Device) -> Self {
        let [width, height] = SIZE;
        let mut scene = generator::Scene::<f32>::cloud(COUNT, width as u32, height as u32, 1.0);
        let focal = scene.config.fx;
        let mut random = Random::new(7);
        let mut change = [Vec::new(), random.values(4 * MOVERS, -0.1, 0.1)];
        for mean in scene.means.chunks_mut(3).take(MOVERS) {
            let z = f64::from(mean[2]);
            let at = |axis: usize, share: f64| {
                let pixel = BLOCK[axis][0] + share * (BLOCK[axis][1] - BLOCK[axis][0]);
                (z * (pixel - 0.5 * SIZE[axis] as f64) / focal) as f32
            };
            (mean[0], mean[1]) = (at(0, random.unit()), at(1, random.unit()));
            let way = |random: &mut Random| (z * WAY * (2.0 * random.unit() - 1.0) / focal) as f32;
            change[0].extend([way(&mut random), way(&mut random), 0.0]);
        }
        let start = [scene.means[..3 * MOVERS].to_vec(), scene.quats[..4 * MOVERS].to_vec()];
        let device = device.clone().autodiff();
        let gaussians = Gaussians::from_tensors(
            tensor(scene.means, [COUNT, 3], &device),
            tensor(scene.quats, [COUNT, 4], &device),
            tensor(scene.log_scales, [COUNT, 3], &device),
            tensor(scene.logits, [COUNT], &device),
            tensor(scene.sh, [COUNT, 16, 3], &device),
        );
        let [cx, cy] = SIZE.map(|side| 0.5 * side as f64);
        let camera = Camera {
            viewmat: tensor(scene.viewmat, [4, 4], &device),
            intrinsics: Intrinsics { fx: focal, fy: focal, cx, cy },
            width,
            height,
        };
        Self { gaussians, camera, moving: (0..MOVERS as u32).collect(), start, change, device }
    }

    fn samples(&self, instants: usize) -> Vec<MovingSample> {
        let at = |group: usize, columns: usize, k: usize| {
            let share = (k as f32 + 0.5) / instants as f32;
            let moved = self.start[group].iter().zip(&self.change[group]).map(|(x, change)| x + share * change);
            tensor(moved.collect(), [MOVERS, columns], &self.device).require_grad()
        };
        (0..instants).map(|k| MovingSample { means: at(0, 3, k), quats: at(1, 4, k) }).collect()
    }

    fn exposure(&self, samples: &[MovingSample]) -> gs_burn::ExposureRendering {
        let options = ExposureOptions { linear: true, ..Default::default() };
        render_exposure(&self.gaussians, &self.moving, samples, &self.camera, &options, None)
    }

    /// One rendering of everything an instant.
    fn renderings(&self, samples: &[MovingSample]) -> Tensor<3> {
        let Gaussians { means, quats, log_scales, opacity_logits, sh, .. } = self.gaussians.clone();
        let one = |sample: &MovingSample| {
            // The movers are the first rows.
            let replaced = |all: Tensor<2>, rows: &Tensor<2>| {
                Tensor::cat(vec![rows.clone(), all.narrow(0, MOVERS, COUNT - MOVERS)], 0)
            };
            let gaussians = Gaussians::from_tensors(
                replaced(means.val(), &sample.means),
                replaced(quats.val(), &sample.quats),
                log_scales.val(),
                opacity_logits.val(),
                sh.val(),
            );
            render(&gaussians, &self.camera, &ExposureOptions::default().render).color
        };
        let sum = samples.iter().map(one).reduce(|sum, color| sum + color).expect("there is a sample");
        sum / samples.len() as f32
    }

    fn step(&self, samples: &[MovingSample], shared: bool, back: bool) {
        let color = if shared { self.exposure(samples).color } else { self.renderings(samples) };
        if back {
            drop((color.clone() * color).mean().backward());
        }
    }
}
