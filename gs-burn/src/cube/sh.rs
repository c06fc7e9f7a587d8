//! Spherical harmonics on a GPU.

use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use gs_kernels::config::{SH_BELOW_THIRD, SH_THIRD, ShConfig};
use gs_kernels::cube::sh;

use super::{Launch, unwrap};
use crate::ops::sh::{ShBandGradients, ShBandKernels, ShGradients, ShKernels};

impl ShKernels for CubeBackend {
    fn sh_forward(
        means: CubeTensor,
        sh: CubeTensor,
        viewmat: CubeTensor,
        projected: CubeTensor,
        config: &ShConfig,
    ) -> CubeTensor {
        let (launch, count) = (Launch::of(&means), means.meta.shape()[0]);
        let [means, sh, viewmat, projected] = [means, sh, viewmat, projected].map(|t| launch.floats(t));
        let colors = sh::forward(&launch.client, &means, &sh, &viewmat, &projected, config);
        launch.float_tensor(unwrap(colors), [count, 3])
    }

    fn sh_backward(
        means: CubeTensor,
        sh: CubeTensor,
        viewmat: CubeTensor,
        projected: CubeTensor,
        config: &ShConfig,
        v_colors: CubeTensor,
        of_pose: bool,
    ) -> ShGradients<Self> {
        let (launch, count) = (Launch::of(&means), means.meta.shape()[0]);
        let [means, sh, viewmat, projected, v_colors] =
            [means, sh, viewmat, projected, v_colors].map(|t| launch.floats(t));
        let gradients =
            unwrap(sh::backward(&launch.client, &means, &sh, &viewmat, &projected, config, &v_colors, of_pose));
        ShGradients {
            means: launch.float_tensor(gradients.means, [count, 3]),
            sh: launch.float_tensor(gradients.sh, [count, config.coefficients, 3]),
            viewmat: gradients.viewmat.map(|pose| launch.float_tensor(pose, [4, 4])),
        }
    }
}

impl ShBandKernels for CubeBackend {
    fn bands_forward(
        means: CubeTensor,
        sh: CubeTensor,
        third: CubeTensor,
        viewmat: CubeTensor,
        projected: CubeTensor,
    ) -> CubeTensor {
        let (launch, count) = (Launch::of(&means), means.meta.shape()[0]);
        let [means, sh, third, viewmat, projected] = [means, sh, third, viewmat, projected].map(|t| launch.floats(t));
        let colors = sh::forward_of_bands(&launch.client, &means, &sh, &third, &viewmat, &projected);
        launch.float_tensor(unwrap(colors), [count, 3])
    }

    fn bands_backward(
        means: CubeTensor,
        sh: CubeTensor,
        third: CubeTensor,
        viewmat: CubeTensor,
        projected: CubeTensor,
        v_colors: CubeTensor,
        of_pose: bool,
    ) -> ShBandGradients<Self> {
        let (launch, count) = (Launch::of(&means), means.meta.shape()[0]);
        let [means, sh, third, viewmat, projected, v_colors] =
            [means, sh, third, viewmat, projected, v_colors].map(|t| launch.floats(t));
        let gradients = unwrap(sh::backward_of_bands(
            &launch.client,
            &means,
            &sh,
            &third,
            &viewmat,
            &projected,
            &v_colors,
            of_pose,
        ));
        ShBandGradients {
            means: launch.float_tensor(gradients.means, [count, 3]),
            sh: launch.float_tensor(gradients.sh, [count, SH_BELOW_THIRD, 3]),
            third: launch.float_tensor(gradients.third, [count, SH_THIRD, 3]),
            viewmat: gradients.viewmat.map(|pose| launch.float_tensor(pose, [4, 4])),
        }
    }
}
