//! Fits Gaussians to a picture: a flat scene in front of a camera that stands still.
//!
//! `cargo run --release -p gs-burn --example fit_image [device]` prints the loss and writes `fit_image.ply`.

use burn::module::Param;
use burn::tensor::{Device, Distribution, Gradients, Tensor};
use gs_burn::ops::adam::{AdamConfig, adam_step};
use gs_burn::ops::ssim::photometric_loss;
use gs_burn::{Camera, Gaussians, Intrinsics, RenderOptions, device, glam::DMat4, ply, render};

const SIZE: usize = 128;
const COUNT: usize = 1000;
const STEPS: u64 = 300;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let name = std::env::args().nth(1).unwrap_or("auto".into());
    let device = device::select(&name)?.autodiff();
    let centre = SIZE as f64 / 2.0;
    let intrinsics = Intrinsics { fx: centre, fy: centre, cx: centre, cy: centre };
    let camera = Camera::from_c2w(DMat4::IDENTITY, intrinsics, SIZE, SIZE, &device);
    let target = picture(&device);

    let mut scene = scatter(&device);
    let mut moments = Moments::default();
    for step in 1..=STEPS {
        let rendering = render(&scene, &camera, &RenderOptions::default());
        let loss = photometric_loss(rendering.color, target.clone(), 0.2);
        let gradients = loss.backward();
        scene = moments.update(scene, &gradients, step);
        if step % 50 == 0 {
            println!("step {step}: loss {:.4}", loss.into_scalar::<f32>());
        }
    }
    ply::write_ply("fit_image.ply", &scene)?;
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

/// Adam's memory of each parameter.
#[derive(Default)]
struct Moments {
    means: Option<[Tensor<2>; 2]>,
    quats: Option<[Tensor<2>; 2]>,
    log_scales: Option<[Tensor<2>; 2]>,
    opacity_logits: Option<[Tensor<1>; 2]>,
    sh: Option<[Tensor<3>; 2]>,
}

impl Moments {
    fn update(&mut self, scene: Gaussians, gradients: &Gradients, step: u64) -> Gaussians {
        let config = |lr| AdamConfig { lr, beta1: 0.9, beta2: 0.999, eps: 1e-15, step };
        let Gaussians { means, quats, log_scales, opacity_logits, sh } = scene;
        Gaussians::from_tensors(
            updated(means, gradients, &mut self.means, config(2e-3)),
            updated(quats, gradients, &mut self.quats, config(1e-2)),
            updated(log_scales, gradients, &mut self.log_scales, config(1e-2)),
            updated(opacity_logits, gradients, &mut self.opacity_logits, config(5e-2)),
            updated(sh, gradients, &mut self.sh, config(2e-2)),
        )
    }
}

fn updated<const D: usize>(
    param: Param<Tensor<D>>,
    gradients: &Gradients,
    moments: &mut Option<[Tensor<D>; 2]>,
    config: AdamConfig,
) -> Tensor<D> {
    let gradient = param.grad(gradients).expect("every parameter takes part in the image");
    let [m, v] = moments.take().unwrap_or_else(|| [gradient.zeros_like(), gradient.zeros_like()]);
    let (param, m, v) = adam_step(param.into_value(), gradient, m, v, &config);
    *moments = Some([m, v]);
    param.autodiff()
}
