//! `gsburn bench`: every operation and one whole step, on a synthetic scene.

use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use burn::module::Module;
use burn::tensor::{Device, Tensor};
use gs_base::Intrinsics;
use gs_burn::ops::{intersect::intersect, projection::project, rasterize::rasterize, sh::sh_colors};
use gs_burn::{Camera, Gaussians, RenderOptions, render};
use gs_kernels::config::{ProjectionConfig, RasterizeConfig};
use gs_kernels::constants::TILE;
use rand::Rng;

use crate::cli::BenchArgs;
use crate::commands::{describe, device, print};
use gs_pipelines::bench::BENCH_STEPS;
use gs_train::config::LossConfig;
use gs_train::fit::losses::{photometric, regularised};
use gs_train::fit::parameters::{from_host, gaussians as gaussians_of};
use gs_train::fit::random::{Purpose, stream};

/// Pixels in a tile, and so the cost of one intersection to the rasterizer.
const PIXELS_PER_TILE: f64 = (TILE * TILE) as f64;

/// Most Gaussians: 16 GB of numbers.
const GAUSSIANS_MAX: usize = 1 << 26;

/// Depths of the synthetic Gaussians, scene units.
const DEPTHS: [f32; 2] = [2.0, 10.0];

/// Median standard deviation of the synthetic Gaussians in the image, pixels, for 100 000 Gaussians at 640 x 480: about
/// that of a trained scene.
const SIZE_PIXELS: f32 = 2.0;

/// Times the operations and prints a table.
///
/// # Errors
/// When the device is not there.
pub fn run(args: &BenchArgs) -> Result<ExitCode> {
    if !(1..=GAUSSIANS_MAX).contains(&args.gaussians) {
        bail!("--gaussians: expected 1 to {GAUSSIANS_MAX}, found {}", args.gaussians);
    }
    let device = device(&args.device)?;
    let (width, height) = (args.width as usize, args.height as usize);
    let degree = usize::from(args.sh_degree);
    let gaussians = scene(args, &device);
    let camera = camera(args, &device);
    let k = camera.intrinsics;
    let options = RenderOptions::default();
    let rendering = render(&gaussians, &camera, &options);
    let intersections = rendering.intersections.get();
    let target = rendering.color.clone() * 0.5 + 0.25;
    print(format!(
        "{} Gaussians, SH degree {degree}, {width}x{height}, {intersections} tile intersections, {}, {} threads",
        args.gaussians,
        describe(&device),
        rayon::current_num_threads()
    ));
    print(format!("{:28} {:>10} {:>20}", "", "ms", "G tile pairs/s"));

    let time = |work: &mut dyn FnMut()| median_time(args.repeat, &device, work);
    let row = |name: &str, time: Duration, pairs: bool| {
        let rate = intersections as f64 * PIXELS_PER_TILE / time.as_secs_f64() / 1e9;
        let rate = if pairs { format!("{rate:.3}") } else { String::new() };
        print(format!("{name:28} {:>10.2} {rate:>20}", time.as_secs_f64() * 1e3));
    };

    let projection = ProjectionConfig {
        width: args.width,
        height: args.height,
        fx: k.fx,
        fy: k.fy,
        cx: k.cx,
        cy: k.cy,
        ..ProjectionConfig::default()
    };
    let projected = || {
        let (quats, log_scales) = (gaussians.quats.val(), gaussians.log_scales.val());
        project(gaussians.means.val(), quats, log_scales, camera.viewmat.clone(), &projection)
    };
    row("project", time(&mut || drop(projected())), false);
    let rows = projected();
    let colors = || sh_colors(gaussians.means.val(), gaussians.sh.val(), camera.viewmat.clone(), rows.clone(), degree);
    row("sh", time(&mut || drop(colors())), false);
    let (features, opacities) = (colors(), gaussians.opacities());
    let lists = || intersect(rows.clone(), opacities.clone(), features.clone(), width, height);
    row("intersect", time(&mut || drop(lists())), false);
    let tiles = lists();
    let image = RasterizeConfig { width: args.width, height: args.height, channels: 3, depth: false };
    let background = Tensor::zeros([3], &device);
    let blend = |rows: Tensor<2>, opacities: Tensor<1>, features: Tensor<2>| {
        rasterize(rows, opacities, features, background.clone(), None, &tiles, &image)
    };
    row("rasterize", time(&mut || drop(blend(rows.clone(), opacities.clone(), features.clone()))), true);
    let both = time(&mut || {
        let [rows, features] = [&rows, &features].map(|t| t.clone().autodiff().require_grad());
        let opacities = opacities.clone().autodiff().require_grad();
        drop(blend(rows, opacities, features).sum().backward());
    });
    row("rasterize, both ways", both, true);
    row("render", time(&mut || drop(render(&gaussians, &camera, &options))), true);
    let loss_config = LossConfig::default();
    let both = time(&mut || {
        let tracked = gaussians.clone().train();
        let color = render(&tracked, &camera, &options).color;
        let loss = photometric(color, target.clone(), None, &loss_config);
        drop(regularised(loss, &tracked, 1.0, false, &loss_config).backward());
    });
    row("render and loss, both ways", both, true);

    let mut step = (BENCH_STEPS[0].begin)(gaussians, &camera);
    row("whole training step", time(&mut step), true);
    Ok(ExitCode::SUCCESS)
}

/// The camera of the benchmark.
pub fn camera(args: &BenchArgs, device: &Device) -> Camera {
    let (width, height) = (args.width as usize, args.height as usize);
    let k = Intrinsics { fx: width as f64, fy: width as f64, cx: width as f64 / 2.0, cy: height as f64 / 2.0 };
    Camera::from_c2w(glam::DMat4::IDENTITY, k, width, height, device)
}

/// Gaussians spread evenly over the image and over depth, with opacities and shapes as varied as those of a trained
/// scene.
pub fn scene(args: &BenchArgs, device: &Device) -> Gaussians {
    let n = args.gaussians;
    let mut rng = stream(0, Purpose::Bench, 0);
    let aspect = args.height as f32 / args.width as f32;
    // A Gaussian's area shrinks as their density grows, so that the overlap is the same at any count and image size.
    let density = (args.width * args.height) as f32 / (640.0 * 480.0) * (1e5 / n as f32);
    let size = SIZE_PIXELS * density.sqrt() / args.width as f32;
    let (mut means, mut quats, mut log_scales) = (Vec::new(), Vec::new(), Vec::new());
    let (mut opacities, mut sh) = (Vec::new(), Vec::new());
    let columns = 3 * (usize::from(args.sh_degree) + 1).pow(2);
    for _ in 0..n {
        let depth = rng.random_range(DEPTHS[0]..DEPTHS[1]);
        let (x, y) = (rng.random_range(-0.5..0.5), rng.random_range(-0.5..0.5) * aspect);
        means.extend([x * depth, y * depth, depth]);
        quats.extend((0..4).map(|_| rng.random_range(-1.0f32..1.0)));
        log_scales.extend((0..3).map(|_| (size * depth).ln() + rng.random_range(-1.0f32..1.0)));
        opacities.push(rng.random_range(-3.0f32..3.0));
        sh.extend((0..columns).map(|column| rng.random_range(-0.5f32..0.5) * if column < 3 { 2.0 } else { 0.3 }));
    }
    let tensor = |values: Vec<f32>| {
        let columns = values.len() / n;
        from_host(values, columns, device)
    };
    gaussians_of([tensor(means), tensor(quats), tensor(log_scales), tensor(opacities), tensor(sh)])
}

/// The median time of `work`, after one run to warm up.
fn median_time(repeat: u32, device: &Device, work: &mut dyn FnMut()) -> Duration {
    let wait = || device.sync().expect("a device that computed before");
    let mut once = || {
        wait();
        let begun = Instant::now();
        work();
        wait();
        begun.elapsed()
    };
    once();
    let mut times: Vec<Duration> = (0..repeat).map(|_| once()).collect();
    times.sort();
    times[times.len() / 2]
}
