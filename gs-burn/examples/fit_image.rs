//! Fits Gaussians to a picture: a flat scene in front of a camera that stands still.
//!
//! `cargo run --release -p gs-burn --example fit_image [device]` prints the loss.

use burn::tensor::{Device, Distribution, Tensor};
use gs_base::Intrinsics;
use gs_burn::ops::ssim::photometric_loss;
use gs_burn::{Adam, AdamRate, Camera, Gaussians, NamedGradients, RenderOptions, device, glam::DMat4, render};

const SIZE: usize = 128;
const COUNT: usize = 1000;
const STEPS: usize = 300;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = std::env::args().nth(1).unwrap_or("auto".into());
    let device = device::select(&name)?.autodiff();
    let centre = SIZE as f64 / 2.0;
    let intrinsics = Intrinsics { fx: centre, fy: centre, cx: centre, cy: centre };
    let camera = Camera::from_c2w(DMat4::IDENTITY, intrinsics, SIZE, SIZE, &device);
    let target = picture(&device);

    let mut scene = scatter(&device);
    let mut adam = Adam::new();
    for step in 1..=STEPS {
        let rendering = render(&scene, &camera, &RenderOptions::default());
        let loss = photometric_loss(rendering.color, target.clone(), 0.2);
        let gradients = NamedGradients::take(&scene, &mut loss.backward());
        scene = adam.step(scene, gradients, rate);
        if step % 50 == 0 {
            println!("step {step}: loss {:.4}", loss.into_scalar::<f32>());
        }
    }
    Ok(())
}

/// A disc that shades from red to yellow on a blue ground.
fn picture(device: &Device) -> Tensor<3> {
    let pixels = (0..SIZE * SIZE).flat_map(|i| {
        let (x, y) = ((i % SIZE) as f32 / SIZE as f32 - 0.5, (i / SIZE) as f32 / SIZE as f32 - 0.5);
        if x * x + y * y < 0.12 { [0.9, 0.5 + x, 0.1] } else { [0.1, 0.2, 0.5 + 0.5 * y] }
    });
    let pixels: Vec<f32> = pixels.collect();
    Tensor::<1>::from_floats(pixels.as_slice(), device).reshape([SIZE, SIZE, 3])
}

/// Small grey Gaussians all over the view, about a unit away.
fn scatter(device: &Device) -> Gaussians {
    let uniform = |columns, low, high| Tensor::<2>::random([COUNT, columns], Distribution::Uniform(low, high), device);
    Gaussians::from_tensors(
        Tensor::cat(vec![uniform(2, -1.0, 1.0), uniform(1, 0.9, 1.1)], 1),
        uniform(4, -1.0, 1.0),
        Tensor::full([COUNT, 3], -3.5, device),
        Tensor::zeros([COUNT], device),
        Tensor::zeros([COUNT, 1, 3], device),
    )
}

/// Learning rates, a step.
fn rate(path: &str) -> Option<AdamRate> {
    let lr = match path {
        "means" => 2e-3,
        "opacity_logits" => 5e-2,
        "sh" => 2e-2,
        _ => 1e-2,
    };
    Some(AdamRate::new(lr))
}
