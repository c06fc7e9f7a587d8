//! A network of this crate, trained by Burn's own optimiser and saved as a Burn record: no trainer of this project is
//! needed.
//!
//! `cargo run --release -p gs-models --example train_network [device]` prints the loss as it falls.
//!
//! The network is that of TaylorMoDe-GS, Eq. 11: how much each moment of the exposure counts at a pixel. Here it learns
//! a leaf shutter, which takes time to open and to close: the moments at both ends count less, and on near, fast
//! surfaces, whose light a small opening already passes, they count more than on far, slow ones.

use std::error::Error;
use std::path::Path;

use burn::config::Config;
use burn::module::Module;
use burn::tensor::activation::softmax;
use burn::tensor::{Device, Tensor, TensorData};
use burn_optim::{AdamConfig, GradientsParams};
use gs_models::taylormode::{BlurWeights, BlurWeightsConfig};

/// Moments of the exposure.
const SAMPLES: usize = 5;
/// Surfaces in the training set.
const PIXELS: usize = 256;

#[allow(dead_code)] // The test that runs this example calls `train` and `save_and_load` itself.
fn main() -> Result<(), Box<dyn Error>> {
    let name = std::env::args().nth(1).unwrap_or("auto".into());
    let device = gs_burn::device::select(&name)?;
    let losses = train(&config(), 300, &device).1;
    for (step, loss) in losses.iter().enumerate().step_by(50) {
        println!("step {step}: loss {loss:.6}");
    }
    println!("step {}: loss {:.6}", losses.len() - 1, losses[losses.len() - 1]);
    Ok(())
}

/// Depths of about 4 scene units, velocities of about 3 scene units per unit of time.
pub fn config() -> BlurWeightsConfig {
    BlurWeightsConfig::new(SAMPLES, 4.0, 3.0).with_seed(1)
}

/// The network after `steps` updates, and the loss before each.
pub fn train(config: &BlurWeightsConfig, steps: usize, device: &Device) -> (BlurWeights, Vec<f32>) {
    let (depth, velocity, target) = surfaces(device);
    // `train` lets the parameters require gradients; a plain device becomes one with autodiff.
    let mut network = config.init(device).train();
    let mut optimiser = AdamConfig::new().init();
    let mut losses = Vec::new();
    for _ in 0..steps {
        let weights = network.forward(depth.clone(), velocity.clone());
        let loss = (weights - target.clone()).square().mean();
        let gradients = GradientsParams::from_grads(loss.backward(), &network);
        network = optimiser.step(1e-2, network, gradients);
        losses.push(loss.into_scalar::<f32>());
    }
    // Outside autodiff again, for inference.
    (network.valid(), losses)
}

/// Writes configuration and parameters to `folder`, and reads the network back from these two files alone.
pub fn save_and_load(
    network: &BlurWeights,
    config: &BlurWeightsConfig,
    folder: &Path,
    device: &Device,
) -> Result<BlurWeights, Box<dyn Error>> {
    config.save(folder.join("blur_weights.json"))?;
    network.clone().save_file(folder.join("blur_weights.bpk"))?;

    let config = BlurWeightsConfig::load(folder.join("blur_weights.json"))?;
    Ok(config.init(device).try_load_file(folder.join("blur_weights.bpk"))?)
}

/// Depth `[P, 1]` and velocity `[P, 3]` of surfaces, and their weights `[P, N]`.
pub fn surfaces(device: &Device) -> (Tensor<2>, Tensor<2>, Tensor<2>) {
    // Halton's sequence: even without a generator of random numbers.
    let halton = |mut i: usize, base: usize| {
        let (mut value, mut share) = (0.0, 1.0);
        while i > 0 {
            share /= base as f32;
            value += share * (i % base) as f32;
            i /= base;
        }
        value
    };
    let column = |base: usize, low: f32, high: f32| {
        let values: Vec<f32> = (1..=PIXELS).map(|i| low + (high - low) * halton(i, base)).collect();
        Tensor::<2>::from_data(TensorData::new(values, [PIXELS, 1]), device)
    };
    let depth = column(2, 2.0, 8.0);
    let velocity = Tensor::cat(vec![column(3, -3.0, 3.0), column(5, -3.0, 3.0), column(7, -3.0, 3.0)], 1);
    // 1 in the middle of the exposure, 0 at its ends.
    let opening: Vec<f32> = (0..SAMPLES).map(|i| 1.0 - (2.0 * i as f32 / (SAMPLES - 1) as f32 - 1.0).abs()).collect();
    let opening = Tensor::<2>::from_data(TensorData::new(opening, [1, SAMPLES]), device);
    let speed = velocity.clone().square().sum_dim(1).sqrt();
    let slowness = (speed / depth.clone() + 0.5).recip();
    (depth, velocity, softmax(opening * slowness, 1))
}
