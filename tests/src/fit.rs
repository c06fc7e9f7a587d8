//! The smallest trainer there can be: render, compare, go back, update.

use burn::tensor::{Gradients, Tensor};
use gs_burn::ops::adam::{AdamConfig, adam_step};
use gs_burn::ops::ssim::photometric_loss;
use gs_burn::{Camera, Gaussians, RenderOptions, render};

/// Weight of D-SSIM in the loss (3DGS).
const LAMBDA_DSSIM: f64 = 0.2;

/// Learning rates of means, quats, log_scales, opacity_logits and sh; 3DGS values, those of the means for a scene of
/// extent 1.
pub const RATES: [f64; 5] = [1.6e-4, 1e-3, 5e-3, 5e-2, 2.5e-3];

/// Gaussians with Adam's moments.
pub struct Fit {
    means: Parameter<2>,
    quats: Parameter<2>,
    log_scales: Parameter<2>,
    opacity_logits: Parameter<1>,
    sh: Parameter<3>,
    steps: u64,
}

impl Fit {
    /// Starts at `gaussians`, with a learning rate for each group.
    pub fn new(gaussians: &Gaussians, [means, quats, log_scales, opacity_logits, sh]: [f64; 5]) -> Self {
        Self {
            means: Parameter::new(gaussians.means.val(), means),
            quats: Parameter::new(gaussians.quats.val(), quats),
            log_scales: Parameter::new(gaussians.log_scales.val(), log_scales),
            opacity_logits: Parameter::new(gaussians.opacity_logits.val(), opacity_logits),
            sh: Parameter::new(gaussians.sh.val(), sh),
            steps: 0,
        }
    }

    /// One step towards `target` `[H, W, 3]`; returns the loss before it, still on the device.
    pub fn step(&mut self, camera: &Camera, options: &RenderOptions, target: &Tensor<3>) -> Tensor<1> {
        self.steps += 1;
        let (means, quats, log_scales) = (self.means.leaf(), self.quats.leaf(), self.log_scales.leaf());
        let (opacity_logits, sh) = (self.opacity_logits.leaf(), self.sh.leaf());
        let gaussians = Gaussians::from_tensors(
            means.clone(),
            quats.clone(),
            log_scales.clone(),
            opacity_logits.clone(),
            sh.clone(),
        );
        let loss = photometric_loss(render(&gaussians, camera, options).color, target.clone(), LAMBDA_DSSIM);
        // Adam writes in place where nobody else holds a parameter: from here on, only the leaves do.
        drop(gaussians);
        let mut gradients = loss.backward();
        self.means.update(means, &mut gradients, self.steps);
        self.quats.update(quats, &mut gradients, self.steps);
        self.log_scales.update(log_scales, &mut gradients, self.steps);
        self.opacity_logits.update(opacity_logits, &mut gradients, self.steps);
        self.sh.update(sh, &mut gradients, self.steps);
        loss.inner()
    }
}

struct Parameter<const D: usize> {
    /// None while a step holds the value as its leaf.
    value: Option<Tensor<D>>,
    moments: Option<[Tensor<D>; 2]>,
    rate: f64,
}

impl<const D: usize> Parameter<D> {
    fn new(value: Tensor<D>, rate: f64) -> Self {
        let value = if value.is_autodiff() { value.inner() } else { value };
        let moments = Some([value.zeros_like(), value.zeros_like()]);
        Self { value: Some(value), moments, rate }
    }

    fn leaf(&mut self) -> Tensor<D> {
        self.value.take().expect("no step is under way").autodiff().require_grad()
    }

    fn update(&mut self, leaf: Tensor<D>, gradients: &mut Gradients, step: u64) {
        let gradient = leaf.grad_remove(gradients).expect("the loss depends on every parameter");
        let [m, v] = self.moments.take().expect("moments are put back after every step");
        let config = AdamConfig { lr: self.rate, beta1: 0.9, beta2: 0.999, eps: 1e-15, step, first_columns: None };
        let (value, m, v) = adam_step(leaf.inner(), gradient, m, v, &config);
        (self.value, self.moments) = (Some(value), Some([m, v]));
    }
}
