//! Updates on a GPU that write the memory they read: noise, statistics, Adam.

use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use gs_kernels::config::{AdamConfig, NoiseConfig, StatisticsConfig};
use gs_kernels::cube::{adam, noise, statistics};

use super::{Launch, owned};
use crate::ops::adam::{AdamKernels, AdamState};
use crate::ops::noise::NoiseKernels;
use crate::ops::statistics::{Statistics, StatisticsKernels};

impl NoiseKernels for CubeBackend {
    fn noise_forward(
        means: CubeTensor,
        quats: CubeTensor,
        log_scales: CubeTensor,
        logits: CubeTensor,
        config: &NoiseConfig,
    ) -> CubeTensor {
        let launch = Launch::of(&means);
        let means = owned(means);
        let [b_means, quats, log_scales, logits] =
            [means.clone(), quats, log_scales, logits].map(|tensor| launch.floats(tensor));
        noise::perturb(&launch.client, &b_means, &quats, &log_scales, &logits, config);
        means
    }
}

impl StatisticsKernels for CubeBackend {
    fn statistics_forward(
        gradient: CubeTensor,
        views: CubeTensor,
        screen: CubeTensor,
        rows: CubeTensor,
        config: &StatisticsConfig,
    ) -> Statistics<Self> {
        let launch = Launch::of(&gradient);
        let [gradient, views] = [gradient, views].map(owned);
        let [b_gradient, b_views, screen, rows] =
            [gradient.clone(), views.clone(), screen, rows].map(|tensor| launch.floats(tensor));
        statistics::gather(&launch.client, &b_gradient, &b_views, &screen, &rows, config);
        Statistics { gradient, views }
    }
}

impl AdamKernels for CubeBackend {
    fn adam_update(
        param: CubeTensor,
        grad: CubeTensor,
        m: CubeTensor,
        v: CubeTensor,
        config: &AdamConfig,
    ) -> AdamState<Self> {
        let launch = Launch::of(&param);
        let [param, m, v] = [param, m, v].map(owned);
        let buffers = [&param, &grad, &m, &v].map(|tensor| launch.floats(tensor.clone()));
        let [b_param, b_grad, b_m, b_v] = &buffers;
        adam::step(&launch.client, b_param, b_grad, b_m, b_v, config);
        AdamState { param, m, v }
    }
}
