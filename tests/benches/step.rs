//! Milliseconds of one whole training step (render, loss, backward, Adam) and of its render alone;
//! `cargo bench -p gs-tests --bench step`. The rate printed is tile pairs a second over the whole time.
#![recursion_limit = "256"]

mod workloads;

use criterion::Throughput;
use gs_burn::{RenderOptions, render};
use gs_tests::fit::{Fit, RATES};
use workloads::PIXELS_PER_TILE;

fn main() {
    let device = workloads::bench_device();
    let mut criterion = workloads::criterion();
    workloads::for_each(&device, |workload| {
        let mut group = criterion.benchmark_group(workload.name.as_str());
        group.throughput(Throughput::Elements(workload.intersections as u64 * PIXELS_PER_TILE));
        let options = RenderOptions::default();
        let (gaussians, camera) = (&workload.gaussians, &workload.camera);
        group.bench_function("render", |bencher| {
            bencher.iter(|| {
                let rendering = render(gaussians, camera, &options);
                device.sync().expect("the device works");
                rendering
            });
        });
        let target = render(gaussians, camera, &options).color * 0.5 + 0.25;
        let mut fit = Fit::new(gaussians, RATES);
        group.bench_function("training step", |bencher| {
            bencher.iter(|| {
                let loss = fit.step(camera, &options, &target);
                device.sync().expect("the device works");
                loss
            });
        });
        group.finish();
    });
    criterion.final_summary();
}
