//! Small random scenes in `f64`, and comparisons of tensors for unit tests.

use burn::tensor::{DType, Device, Gradients, Tensor, TensorData};
use gs_base::Intrinsics;
use gs_kernels::config::ProjectionConfig;

use crate::{Camera, Gaussians};

/// A CPU device that records gradients.
pub fn device() -> Device {
    #[cfg(feature = "flex")]
    return Device::flex().autodiff();
    #[cfg(not(feature = "flex"))]
    return Device::ndarray().autodiff();
}

/// Uniform numbers from a seed, the same on every machine.
pub struct Random(pub u64);

impl Random {
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * ((self.0 >> 11) as f64 / (1_u64 << 53) as f64)
    }

    pub fn tensor<const D: usize>(&mut self, shape: [usize; D], low: f64, high: f64) -> Tensor<D> {
        let values: Vec<f64> = (0..shape.iter().product()).map(|_| self.uniform(low, high)).collect();
        tensor(values, shape)
    }
}

/// An `f64` tensor.
pub fn tensor<const D: usize>(values: Vec<f64>, shape: [usize; D]) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values, shape), (&device(), DType::F64))
}

/// The parameters of a scene in front of a slightly turned camera, each a leaf that requires a gradient.
#[derive(Clone)]
pub struct Scene {
    pub means: Tensor<2>,
    pub quats: Tensor<2>,
    pub log_scales: Tensor<2>,
    pub opacity_logits: Tensor<1>,
    pub sh: Tensor<3>,
    pub viewmat: Tensor<2>,
    pub config: ProjectionConfig,
}

impl Scene {
    pub fn random(count: usize, degree: usize, seed: u64) -> Self {
        let mut random = Random(seed);
        let coefficients = (degree + 1) * (degree + 1);
        let mut means = Vec::new();
        for _ in 0..count {
            means.extend([random.uniform(-1.2, 1.2), random.uniform(-0.9, 0.9), random.uniform(2.0, 5.0)]);
        }
        let (sin, cos) = 0.1_f64.sin_cos();
        let viewmat = vec![cos, 0.0, sin, 0.05, 0.0, 1.0, 0.0, -0.1, -sin, 0.0, cos, 0.2, 0.0, 0.0, 0.0, 1.0];
        Self {
            means: tensor(means, [count, 3]).require_grad(),
            quats: random.tensor([count, 4], -1.0, 1.0).require_grad(),
            log_scales: random.tensor([count, 3], -3.5, -1.0).require_grad(),
            opacity_logits: random.tensor([count], -2.0, 3.0).require_grad(),
            sh: random.tensor([count, coefficients, 3], -0.5, 0.5).require_grad(),
            viewmat: tensor(viewmat, [4, 4]).require_grad(),
            config: ProjectionConfig {
                width: 37,
                height: 26,
                fx: 30.0,
                fy: 33.0,
                cx: 18.0,
                cy: 13.5,
                antialiased: true,
                ..Default::default()
            },
        }
    }

    pub fn gaussians(&self) -> Gaussians {
        let Self { means, quats, log_scales, opacity_logits, sh, .. } = self.clone();
        Gaussians::from_tensors(means, quats, log_scales, opacity_logits, sh)
    }

    pub fn camera(&self) -> Camera {
        let ProjectionConfig { fx, fy, cx, cy, width, height, .. } = self.config;
        Camera {
            viewmat: self.viewmat.clone(),
            intrinsics: Intrinsics { fx, fy, cx, cy },
            width: width as usize,
            height: height as usize,
        }
    }
}

pub fn values<const D: usize>(tensor: &Tensor<D>) -> Vec<f64> {
    tensor.to_data().iter::<f64>().collect()
}

/// Asserts that no element differs by more than `tolerance` times the largest magnitude.
#[track_caller]
pub fn assert_close<const D: usize>(name: &str, actual: &Tensor<D>, expected: &Tensor<D>, tolerance: f64) {
    assert_eq!(actual.dims(), expected.dims(), "shape of {name}");
    let (actual, expected) = (values(actual), values(expected));
    let scale = expected.iter().fold(0.0_f64, |max, x| max.max(x.abs()));
    for (i, (a, e)) in actual.iter().zip(&expected).enumerate() {
        assert!((a - e).abs() <= tolerance * scale, "{name}[{i}]: {a} instead of {e}, scale {scale}");
    }
}

/// Finds the gradient of one leaf, flat.
pub type GradientOf = dyn Fn(&Gradients) -> Option<Tensor<1>>;

/// Asserts that two functions of tensors that share leaves agree in value (1e-10) and in every leaf's gradient (1e-8),
/// for a random gradient of the result.
#[track_caller]
pub fn assert_same_gradients<const D: usize>(actual: Tensor<D>, expected: Tensor<D>, leaves: &[(&str, &GradientOf)]) {
    assert_close("value", &actual, &expected, 1e-10);
    let v = Random(99).tensor(actual.dims(), -1.0, 1.0);
    let (actual, expected) = ((actual * v.clone()).sum().backward(), (expected * v).sum().backward());
    for (name, gradient) in leaves {
        let (actual, expected) = (gradient(&actual), gradient(&expected));
        let actual = actual.unwrap_or_else(|| panic!("{name} has a gradient"));
        let expected = expected.unwrap_or_else(|| panic!("{name} has a reference gradient"));
        let largest = values(&expected).iter().fold(0.0_f64, |max, x| max.max(x.abs()));
        assert!(largest > 0.0, "the gradient of {name} is not all zero");
        assert_close(name, &actual, &expected, 1e-8);
    }
}

/// The gradient of a leaf, flat, for [`assert_same_gradients`].
pub fn gradient_of<const D: usize>(leaf: &Tensor<D>) -> impl Fn(&Gradients) -> Option<Tensor<1>> + use<D> {
    let leaf = leaf.clone();
    move |gradients| leaf.grad(gradients).map(|gradient| gradient.flatten(0, D - 1))
}
