//! Spherical harmonics on a GPU.

use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use gs_kernels::config::ShConfig;
use gs_kernels::cube::sh;

use super::{Launch, unwrap};
use crate::ops::sh::{ShGradients, ShKernels};

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
