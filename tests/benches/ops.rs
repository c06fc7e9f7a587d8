//! Milliseconds of each op, forward and backward, as a Burn user calls it; `cargo bench -p gs-tests --bench ops`.
//!
//! The rate printed with `rasterize` is tile pairs a second: intersections x 256 pixels over the time. A backward is
//! measured with the product by the output's gradient that starts it.
#![recursion_limit = "256"]

mod workloads;

use burn::tensor::{Device, Tensor};
use criterion::{BatchSize, BenchmarkGroup, Criterion, Throughput};
use gs_burn::ops::intersect::intersect;
use gs_burn::ops::projection::project;
use gs_burn::ops::rasterize::{RasterizeConfig, rasterize};
use gs_burn::ops::sh::sh_colors;
use gs_burn::ops::ssim::photometric_loss;
use workloads::{Clock, PIXELS_PER_TILE, Workload};

fn main() {
    let device = workloads::bench_device();
    let mut criterion = workloads::criterion();
    workloads::for_each(&device, |workload| ops(&mut criterion, workload, &device));
    criterion.final_summary();
}

fn leaf<const D: usize>(tensor: &Tensor<D>) -> Tensor<D> {
    tensor.clone().autodiff().require_grad()
}

/// Measures `run`, waiting for the device.
fn forward<T>(group: &mut BenchmarkGroup<'_, Clock>, name: &str, device: &Device, run: impl Fn() -> T) {
    group.bench_function(name, |bencher| {
        bencher.iter(|| {
            let result = run();
            device.sync().expect("the device works");
            result
        });
    });
}

/// Measures the backward pass of what `run` makes.
fn backward(group: &mut BenchmarkGroup<'_, Clock>, name: &str, device: &Device, run: impl Fn() -> Tensor<1>) {
    group.bench_function(name, |bencher| {
        let setup = || {
            let output = run();
            device.sync().expect("the device works");
            output
        };
        let back = |output: Tensor<1>| {
            let gradients = output.backward();
            device.sync().expect("the device works");
            gradients
        };
        bencher.iter_batched(setup, back, BatchSize::PerIteration);
    });
}

fn ops(criterion: &mut Criterion<Clock>, workload: &Workload, device: &Device) {
    let Workload { name, gaussians, camera, config, intersections } = workload;
    let [means, quats, log_scales] =
        [&gaussians.means, &gaussians.quats, &gaussians.log_scales].map(|parameter| parameter.val());
    let (sh, opacities, viewmat) = (gaussians.sh.val(), gaussians.opacities(), camera.viewmat.clone());
    let degree = gaussians.sh_degree();
    let (width, height) = (camera.width, camera.height);
    let mut group = criterion.benchmark_group(name.as_str());

    let projected = |means, quats, log_scales, viewmat| project(means, quats, log_scales, viewmat, config);
    let inputs = || (means.clone(), quats.clone(), log_scales.clone(), viewmat.clone());
    let run = || {
        let (means, quats, log_scales, viewmat) = inputs();
        projected(means, quats, log_scales, viewmat)
    };
    forward(&mut group, "project", device, run);
    let rows = run();
    let ones = rows.ones_like().autodiff();
    backward(&mut group, "project backward", device, || {
        (projected(leaf(&means), leaf(&quats), leaf(&log_scales), leaf(&viewmat)) * ones.clone()).sum()
    });

    let colors = |means, sh, viewmat| sh_colors(means, sh, viewmat, rows.clone(), degree);
    forward(&mut group, "sh", device, || colors(means.clone(), sh.clone(), viewmat.clone()));
    backward(&mut group, "sh backward", device, || {
        let rows = rows.clone().autodiff();
        sh_colors(leaf(&means), leaf(&sh), leaf(&viewmat), rows, degree).sum()
    });

    let features = colors(means.clone(), sh.clone(), viewmat.clone());
    let run = || intersect(rows.clone(), opacities.clone(), features.clone(), width, height);
    forward(&mut group, "intersect", device, run);
    let lists = run();

    let image = RasterizeConfig { width: width as u32, height: height as u32, channels: 3, depth: false };
    let background = Tensor::<1>::zeros([3], device);
    group.throughput(Throughput::Elements(*intersections as u64 * PIXELS_PER_TILE));
    let run = || rasterize(rows.clone(), opacities.clone(), features.clone(), background.clone(), None, &lists, &image);
    forward(&mut group, "rasterize", device, run);
    let rendered = run();
    let weights = (rendered.clone() - 0.4).autodiff();
    backward(&mut group, "rasterize backward", device, || {
        let background = background.clone().autodiff();
        let (rows, opacities, features) = (leaf(&rows), leaf(&opacities), leaf(&features));
        (rasterize(rows, opacities, features, background, None, &lists, &image) * weights.clone()).sum()
    });
    group.finish();

    let mut group = criterion.benchmark_group(name.as_str());
    let color = rendered.narrow(2, 0, 3);
    let target = color.clone() * 0.5 + 0.25;
    forward(&mut group, "ssim", device, || photometric_loss(color.clone(), target.clone(), 0.2));
    let tracked = target.clone().autodiff();
    backward(&mut group, "ssim backward", device, || photometric_loss(leaf(&color), tracked.clone(), 0.2));
    group.finish();
}
