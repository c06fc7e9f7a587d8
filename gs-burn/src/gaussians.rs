//! The scene: a Burn module of Gaussians.

use burn::module::{Module, Param, ParamId};
use burn::tensor::{Device, Tensor, assert_shape};

use crate::ops::opacity::opacities;

/// `N` Gaussians with view-dependent colour.
#[derive(Module, Debug)]
pub struct Gaussians {
    /// Means `[N, 3]`, world, scene units.
    pub means: Param<Tensor<2>>,
    /// Orientations `[N, 4]`, w x y z of any norm; normalised on use.
    pub quats: Param<Tensor<2>>,
    /// Natural logarithms of the standard deviations along the Gaussian's own axes, `[N, 3]`, scene units.
    pub log_scales: Param<Tensor<2>>,
    /// Opacities before the sigmoid, `[N]`.
    pub opacity_logits: Param<Tensor<1>>,
    /// Spherical harmonics coefficients `[N, S, 3]`, `S` = (degree + 1)^2.
    pub sh: Param<Tensor<3>>,
}

impl Gaussians {
    /// Gaussians from tensors of the shapes given at the fields.
    ///
    /// A tensor outside any graph becomes a trainable parameter: on an autodiff device it requires a gradient. A tensor
    /// that is already tracked, such as the output of a motion model, stays in its graph and passes its gradient on.
    ///
    /// # Panics
    /// When shapes disagree or `S` is not 1, 4, 9 or 16.
    pub fn from_tensors(
        means: Tensor<2>,
        quats: Tensor<2>,
        log_scales: Tensor<2>,
        opacity_logits: Tensor<1>,
        sh: Tensor<3>,
    ) -> Self {
        let [count, coefficients, _] = sh.dims();
        assert_shape!(means, [count, 3]);
        assert_shape!(quats, [count, 4]);
        assert_shape!(log_scales, [count, 3]);
        assert_shape!(opacity_logits, [count]);
        assert_shape!(sh, [count, coefficients, 3]);
        assert!(
            [1, 4, 9, 16].contains(&coefficients),
            "sh must hold 1, 4, 9 or 16 coefficients a Gaussian, it holds {coefficients}"
        );
        Self {
            means: parameter(means),
            quats: parameter(quats),
            log_scales: parameter(log_scales),
            opacity_logits: parameter(opacity_logits),
            sh: parameter(sh),
        }
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.means.dims()[0]
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Stored degree of the spherical harmonics, 0 to 3.
    pub fn sh_degree(&self) -> usize {
        self.sh.dims()[1].isqrt() - 1
    }

    /// Opacities `[N]`, 0 to 1; 0 where the logit is not a number, and that logit receives no gradient.
    pub fn opacities(&self) -> Tensor<1> {
        opacities(self.opacity_logits.val())
    }

    /// Standard deviations `[N, 3]`, scene units.
    pub fn scales(&self) -> Tensor<2> {
        self.log_scales.val().exp()
    }

    /// The device of the parameters.
    pub fn device(&self) -> Device {
        self.means.device()
    }
}

fn parameter<const D: usize>(tensor: Tensor<D>) -> Param<Tensor<D>> {
    // `Param::from_tensor` makes a leaf of its argument and refuses the result of other operations.
    if tensor.is_tracked() { Param::initialized(ParamId::new(), tensor) } else { Param::from_tensor(tensor) }
}
