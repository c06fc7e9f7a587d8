//! Learns to tell ground, walls and balls apart in clouds of points, by their shape alone.
//!
//! `cargo run --release -p gs-models --example segment_points [device]` prints loss and accuracy. The network sees
//! which voxels hold points, and nothing of where they are: clouds are lifted and moved at random, and every point
//! has the same feature.

use burn::module::Module;
use burn::nn::loss::CrossEntropyLossConfig;
use burn::tensor::{Device, Int, Tensor, TensorData};
use burn_optim::{AdamConfig, GradientsParams};
use gs_models::flux4d::unet::{SparseUnet, SparseUnetConfig, VoxelPyramid};

/// Edge of a voxel, metres.
const VOXEL: f32 = 0.25;
const CLASSES: usize = 3;

/// A cloud of points and the class of each: 0 ground, 1 wall, 2 ball.
pub struct Cloud {
    /// Positions, metres.
    pub points: Vec<[f32; 3]>,
    /// The class of each point.
    pub classes: Vec<i32>,
}

#[allow(dead_code)] // the tests take this file as a module
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = std::env::args().nth(1).unwrap_or("auto".into());
    let device = gs_burn::device::select(&name)?;
    let network = train(100, &device, |step, loss| {
        if step % 10 == 0 {
            println!("step {step}: loss {loss:.3}");
        }
    })?;
    println!("accuracy on clouds it has not seen: {:.3}", accuracy(&network, &device)?);
    Ok(())
}

/// A small UNet: three levels of voxels, one block each.
pub fn config() -> SparseUnetConfig {
    let config = SparseUnetConfig::new(1, CLASSES).with_stem(16).with_encoder(vec![16, 32]).with_decoder(vec![32, 16]);
    config.with_blocks(1).with_seed(1)
}

/// Trains on a new cloud each step. The running statistics of the batch norms follow a tenth a step, so fewer than a
/// hundred steps are answered worse than they were learned.
pub fn train(
    steps: u64,
    device: &Device,
    mut told: impl FnMut(u64, f32),
) -> Result<SparseUnet, Box<dyn std::error::Error>> {
    let config = config();
    // `train` lets the parameters require gradients; a plain device becomes one with autodiff.
    let mut network = config.init(device).train();
    let mut optimiser = AdamConfig::new().init();
    for step in 1..=steps {
        let cloud = cloud(step);
        let scores = scores(&network, &cloud, config.levels(), device)?;
        let classes = TensorData::new(cloud.classes.clone(), [cloud.classes.len()]);
        let classes = Tensor::<1, Int>::from_data(classes, &scores.device());
        let loss = CrossEntropyLossConfig::new().init(&scores.device()).forward(scores, classes);
        let gradients = GradientsParams::from_grads(loss.backward(), &network);
        network = optimiser.step(1e-2, network, gradients);
        told(step, loss.into_scalar::<f32>());
    }
    Ok(network)
}

/// `[N, classes]`
fn scores(
    network: &SparseUnet,
    cloud: &Cloud,
    levels: usize,
    device: &Device,
) -> Result<Tensor<2>, Box<dyn std::error::Error>> {
    let pyramid = VoxelPyramid::of(&cloud.points, VOXEL, levels, device)?;
    Ok(network.forward(Tensor::ones([cloud.points.len(), 1], device), &pyramid))
}

/// Share of points with the right class in clouds that were not trained on, by the running statistics of the batch
/// norms.
pub fn accuracy(network: &SparseUnet, device: &Device) -> Result<f64, Box<dyn std::error::Error>> {
    let network = network.clone().valid();
    let (mut right, mut all) = (0, 0);
    for seed in 1_000_000..1_000_005 {
        let cloud = cloud(seed);
        let scores = scores(&network, &cloud, config().levels(), device)?;
        let found: Vec<i32> = scores.argmax(1).into_data().iter::<i32>().collect();
        right += found.iter().zip(&cloud.classes).filter(|(a, b)| a == b).count();
        all += cloud.classes.len();
    }
    Ok(right as f64 / all as f64)
}

/// A ground of 8 by 8 metres, three walls and three balls on it, seen with a few centimetres of noise; 3,600 points.
pub fn cloud(seed: u64) -> Cloud {
    let mut random = Random(seed);
    let mut cloud = Cloud { points: Vec::new(), classes: Vec::new() };
    let shift = [(); 3].map(|()| random.within(-5.0, 5.0));
    let mut put = |random: &mut Random, class, point: [f32; 3]| {
        let noise = [(); 3].map(|()| random.within(-0.03, 0.03));
        cloud.points.push(std::array::from_fn(|axis| point[axis] + shift[axis] + noise[axis]));
        cloud.classes.push(class);
    };
    for _ in 0..1800 {
        let [x, y] = [(); 2].map(|()| random.within(0.0, 8.0));
        put(&mut random, 0, [x, y, 0.0]);
    }
    for _ in 0..3 {
        let [x, y] = [(); 2].map(|()| random.within(1.0, 7.0));
        let (sin, cos) = random.within(0.0, std::f32::consts::TAU).sin_cos();
        for _ in 0..400 {
            let (along, up) = (random.within(-1.0, 1.0), random.within(0.2, 2.5));
            put(&mut random, 1, [x + along * cos, y + along * sin, up]);
        }
    }
    for _ in 0..3 {
        let centre = [random.within(1.0, 7.0), random.within(1.0, 7.0), random.within(1.0, 2.0)];
        for _ in 0..200 {
            // Uniform on the sphere: the height is uniform, and so is the angle.
            let (z, angle) = (random.within(-1.0, 1.0), random.within(0.0, std::f32::consts::TAU));
            let around = (1.0 - z * z).sqrt();
            let point = [around * angle.cos(), around * angle.sin(), z];
            put(&mut random, 2, std::array::from_fn(|axis| centre[axis] + 0.5 * point[axis]));
        }
    }
    cloud
}

/// SplitMix64: the same numbers on every machine.
struct Random(u64);

impl Random {
    fn within(&mut self, low: f32, high: f32) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        low + (high - low) * ((z ^ (z >> 31)) >> 40) as f32 / (1_u64 << 24) as f32
    }
}
