//! What is measured, and on what.
//!
//! | workload | Gaussians | image |
//! |---|---|---|
//! | `100k` | 100 000, generated | 640 x 480 |
//! | `1M` | 1 000 000, generated | 1280 x 720 |
//! | `real` | the PLY file named by `GS_BENCH_PLY` | the first camera of the transforms.json, or the first held-out photo of the data set, named by `GS_BENCH_CAMERAS`; or one in front of the scene |
//!
//! `GS_BENCH_DEVICE` names the device as `gsburn --device` does; the default is `flex`. `GS_BENCH_CLOCK` says what is
//! measured: `cpu`, the processor time of all threads (the default), or `wall`, the time that passes.

#![allow(dead_code)] // each benchmark uses its own part

use std::path::Path;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use burn::tensor::{Device, Tensor, TensorData};
use criterion::Criterion;
use criterion::measurement::{Measurement, ValueFormatter, WallTime};
use gs_base::Intrinsics;
use gs_burn::{Camera, Gaussians, RenderOptions, device, glam, ply, render};
use gs_kernels::config::ProjectionConfig;

#[path = "../../../gs-kernels/tests/scenes/mod.rs"]
pub mod generator;

#[path = "../../../gs-kernels/tests/scenes/clock.rs"]
pub mod clock;

/// A scene and a camera, without gradient tracking.
pub struct Workload {
    pub name: String,
    pub gaussians: Gaussians,
    pub camera: Camera,
    pub config: ProjectionConfig,
    /// (tile, Gaussian) pairs of the image.
    pub intersections: usize,
}

/// Pixels of a tile: what one intersection costs at most.
pub const PIXELS_PER_TILE: u64 = (gs_kernels::constants::TILE * gs_kernels::constants::TILE) as u64;

/// The device of `GS_BENCH_DEVICE`.
pub fn bench_device() -> Device {
    let name = std::env::var("GS_BENCH_DEVICE").unwrap_or_else(|_| "flex".to_owned());
    device::select(&name).unwrap_or_else(|error| panic!("GS_BENCH_DEVICE: {error}"))
}

/// What a benchmark's milliseconds are.
#[derive(Clone, Copy, Debug)]
pub enum Clock {
    /// Processor time of all threads: other work on the machine shows in it by little. Of no use for a GPU.
    Cpu,
    /// Time that passes.
    Wall,
}

impl Clock {
    /// The clock of `GS_BENCH_CLOCK`.
    fn chosen() -> Self {
        match std::env::var("GS_BENCH_CLOCK").as_deref() {
            Err(_) | Ok("cpu") => Self::Cpu,
            Ok("wall") => Self::Wall,
            Ok(other) => panic!("GS_BENCH_CLOCK is cpu or wall, not {other}"),
        }
    }

    /// Nanoseconds since some moment.
    fn now(self) -> f64 {
        static START: LazyLock<Instant> = LazyLock::new(Instant::now);
        1e9 * match self {
            Self::Cpu => clock::cpu_seconds(),
            Self::Wall => START.elapsed().as_secs_f64(),
        }
    }
}

impl Measurement for Clock {
    type Intermediate = f64;
    type Value = f64;

    fn start(&self) -> f64 {
        self.now()
    }

    fn end(&self, start: f64) -> f64 {
        self.now() - start
    }

    fn add(&self, a: &f64, b: &f64) -> f64 {
        a + b
    }

    fn zero(&self) -> f64 {
        0.0
    }

    fn to_f64(&self, value: &f64) -> f64 {
        *value
    }

    fn formatter(&self) -> &dyn ValueFormatter {
        WallTime.formatter()
    }
}

/// Ten short samples: the whole run is to take minutes on two cores, and these times vary by percents.
pub fn criterion() -> Criterion<Clock> {
    Criterion::default()
        .with_measurement(Clock::chosen())
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(1000))
        .without_plots()
        .configure_from_args()
}

/// Builds the workloads one after the other, so that one is in memory at a time.
pub fn for_each(device: &Device, mut measure: impl FnMut(&Workload)) {
    measure(&generated("100k", 100_000, 640, 480, device));
    measure(&generated("1M", 1_000_000, 1280, 720, device));
    match std::env::var("GS_BENCH_PLY") {
        Ok(path) => measure(&trained(&path, device)),
        Err(_) => println!("real: skipped, GS_BENCH_PLY names no PLY file of a trained scene"),
    }
}

fn generated(name: &str, count: usize, width: u32, height: u32, device: &Device) -> Workload {
    let scene = generator::Scene::<f32>::cloud(count, width, height, 1.0);
    fn tensor<const D: usize>(values: Vec<f32>, shape: [usize; D], device: &Device) -> Tensor<D> {
        Tensor::from_data(TensorData::new(values, shape), device)
    }
    let ProjectionConfig { fx, fy, cx, cy, .. } = scene.config;
    let camera = Camera {
        viewmat: tensor(scene.viewmat, [4, 4], device),
        intrinsics: Intrinsics { fx, fy, cx, cy },
        width: width as usize,
        height: height as usize,
    };
    let gaussians = Gaussians::from_tensors(
        tensor(scene.means, [count, 3], device),
        tensor(scene.quats, [count, 4], device),
        tensor(scene.log_scales, [count, 3], device),
        tensor(scene.logits, [count], device),
        tensor(scene.sh, [count, 16, 3], device),
    );
    workload(name, gaussians, camera)
}

fn trained(path: &str, device: &Device) -> Workload {
    let gaussians = ply::read_ply(path, device).unwrap_or_else(|error| panic!("GS_BENCH_PLY: {error}"));
    let camera = match std::env::var("GS_BENCH_CAMERAS") {
        Ok(path) => held_out(path.as_ref(), device),
        Err(_) => in_front(&gaussians, device),
    };
    workload("real", gaussians, camera)
}

/// The first camera of a transforms.json file, or of the photos that a data set holds out, at most [`WIDTH`] pixels wide.
fn held_out(path: &Path, device: &Device) -> Camera {
    let (c2w, intrinsics, width, height) = if path.is_file() {
        let cameras = gs_datasets::load_cameras(path).unwrap_or_else(|error| panic!("GS_BENCH_CAMERAS: {error}"));
        let first = cameras.first().unwrap_or_else(|| panic!("GS_BENCH_CAMERAS: {} holds no camera", path.display()));
        (first.c2w, first.intrinsics, first.width, first.height)
    } else {
        let options = gs_datasets::LoadOptions { max_width: Some(WIDTH), ..gs_datasets::LoadOptions::default() };
        let scene = gs_datasets::load(path, &options).unwrap_or_else(|error| panic!("GS_BENCH_CAMERAS: {error}"));
        let first = scene.held_out_views().next().or(scene.train.first()).expect("a scene that loads has views");
        // A PLY file is in the data set's world, views are where training is.
        let c2w = glam::DMat4::from_translation(scene.origin) * first.c2w;
        (c2w, first.intrinsics, first.width, first.height)
    };
    Camera::from_c2w(c2w, intrinsics, width, height, device)
}

/// Widest photo of a data set, pixels: that of the README's tables.
const WIDTH: usize = 480;

/// A camera of 60 degrees that looks along z at the middle of the scene from as far as most of it fits.
fn in_front(gaussians: &Gaussians, device: &Device) -> Camera {
    let means: Vec<f32> = gaussians.means.val().into_data().iter::<f32>().collect();
    let quantile = |axis: usize, share: f64| {
        let mut column: Vec<f32> = means.iter().skip(axis).step_by(3).copied().collect();
        column.sort_by(f32::total_cmp);
        f64::from(column[((column.len() - 1) as f64 * share) as usize])
    };
    let [x, y, z] = [0, 1, 2].map(|axis| quantile(axis, 0.5));
    let reach = (quantile(0, 0.9) - quantile(0, 0.1)).max(quantile(1, 0.9) - quantile(1, 0.1));
    let (width, height, focal) = (960_usize, 640_usize, 831.0);
    let distance = reach * focal / width as f64;
    let viewmat = [1.0, 0.0, 0.0, -x, 0.0, 1.0, 0.0, -y, 0.0, 0.0, 1.0, distance - z, 0.0, 0.0, 0.0, 1.0];
    Camera {
        viewmat: Tensor::<1>::from_data(viewmat, device).reshape([4, 4]),
        intrinsics: Intrinsics { fx: focal, fy: focal, cx: width as f64 / 2.0, cy: height as f64 / 2.0 },
        width,
        height,
    }
}

fn workload(name: &str, gaussians: Gaussians, camera: Camera) -> Workload {
    let intersections = render(&gaussians, &camera, &RenderOptions::default()).intersections.get();
    let (count, Camera { width, height, intrinsics: Intrinsics { fx, fy, cx, cy }, .. }) = (gaussians.len(), &camera);
    println!("{name}: {count} Gaussians, {width}x{height}, {intersections} intersections");
    let config = ProjectionConfig {
        width: *width as u32,
        height: *height as u32,
        fx: *fx,
        fy: *fy,
        cx: *cx,
        cy: *cy,
        ..Default::default()
    };
    Workload { name: name.to_owned(), gaussians, camera, config, intersections }
}
