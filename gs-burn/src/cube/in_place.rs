//! Updates on a GPU that write the memory they read: noise, statistics, Adam.

use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use gs_kernels::cube::{adam, noise, statistics};

use super::{Launch, owned};
use crate::ops::adam::AdamStep;
use crate::ops::noise::Noise;
use crate::ops::operation::{ComputeOnCube, Tensors};
use crate::ops::statistics::Statistics;

impl ComputeOnCube<4, 0> for Noise {
    fn compute(
        &self,
        [means, quats, log_scales, logits]: [CubeTensor; 4],
        []: [CubeTensor; 0],
    ) -> Tensors<CubeBackend> {
        let (launch, means) = (Launch::of(&means), owned(means));
        let [b_means, quats, log_scales, logits] =
            [means.clone(), quats, log_scales, logits].map(|tensor| launch.floats(tensor));
        noise::perturb(&launch.client, &b_means, &quats, &log_scales, &logits, &self.0);
        Tensors::of_floats([means])
    }
}

impl ComputeOnCube<4, 0> for Statistics {
    fn compute(&self, [gradient, views, screen, rows]: [CubeTensor; 4], []: [CubeTensor; 0]) -> Tensors<CubeBackend> {
        let launch = Launch::of(&gradient);
        let [gradient, views] = [gradient, views].map(owned);
        let [b_gradient, b_views, screen, rows] =
            [gradient.clone(), views.clone(), screen, rows].map(|tensor| launch.floats(tensor));
        statistics::gather(&launch.client, &b_gradient, &b_views, &screen, &rows, &self.0);
        Tensors::of_floats([gradient, views])
    }
}

impl ComputeOnCube<4, 0> for AdamStep {
    fn compute(&self, [param, grad, m, v]: [CubeTensor; 4], []: [CubeTensor; 0]) -> Tensors<CubeBackend> {
        let launch = Launch::of(&param);
        let [param, m, v] = [param, m, v].map(owned);
        let buffers = [&param, &grad, &m, &v].map(|tensor| launch.floats(tensor.clone()));
        let [b_param, b_grad, b_m, b_v] = &buffers;
        adam::step(&launch.client, b_param, b_grad, b_m, b_v, &self.0);
        Tensors::of_floats([param, m, v])
    }
}
