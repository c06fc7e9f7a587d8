//! The launches of a training step on a GPU, counted on a software one. A program of its own: launches are recorded
//! before a GPU is opened.
#![cfg(any(feature = "wgpu", feature = "vulkan"))]
#![recursion_limit = "256"]

use clap::Parser;
use gs_burn::launches::{KernelLaunch, LaunchRecorder};
use gs_kernels::cube::buffer::{UNITS, downloads};
use gs_pipelines::bench::BENCH_STEPS;
use gsburn::cli::{Cli, Command};
use gsburn::commands::bench::{camera, scene};

/// Most launches of a step of `static`, MCMC or classic: each takes 5 to 15 microseconds on CUDA and up to 40 through
/// wgpu, and a step of 100,000 Gaussians at 640 x 480 has about one millisecond of work.
const MOST: usize = 80;

/// The exact exposure: motion, rows, copies and their backward as tensors of all instants, whatever their number. It
/// had 865 when each instant had its own, and 246 when the lists of tiles were made on the host, for which the GPU
/// waited; the kernels that make them are 45 launches, six find the Gaussians that strayed from their body, and five
/// move the body itself.
const MOST_INTEGRATED: usize = 302;

/// The paper's warp: depth, velocity, path and weights at the moving pixels, and the derivatives of the whole formed
/// image, which Eq. 14 compares where no pseudo-sharp photo is given. It had 459 when that image was only shown, and
/// eleven less while strays turned with their body, which had no path.
const MOST_WARPED: usize = 471;

/// A product of small matrices and a sum in the warp's networks, whose launches have one and two cubes.
const SERIAL_WARPED: usize = 2;

/// Fewest units of a launch whose work grows with the scene: a launch below it leaves most of a large GPU idle.
const UNITS_MIN: u64 = 4096;

/// Units of a cube where nothing is known: of the kernels of rasterization, and of most of Burn's, which have at
/// least 32.
const UNITS_OF_A_CUBE: u64 = 64;

/// This project's kernels that work on a row or a number a unit, 256 units a cube.
const OF_256_UNITS: [&str; 4] = ["rows_of::", "sh_forward", "sh_backward", "opacity::"];

/// Kernels whose launches may be small, because their work does not grow with the scene beyond the number in
/// brackets.
const SMALL_WORK: [(&str, &str); 15] = [
    ("sum::", "8 values a unit, or the second level: 1,024 parts"),
    ("scan::", "8 values a unit"),
    ("products::group_sum_kernel", "at most 1,024 values a unit"),
    ("products::group_product_kernel", "at most 256 rows a unit"),
    ("products::group_dot_kernel", "at most 256 values a unit"),
    ("adam::", "a number a unit; networks and the exposure have few"),
    ("gather::background_sum_kernel", "a value a tile and channel"),
    ("backward::pose_sum_kernel", "12 values for 256 Gaussians"),
    ("backward::centre_sum_kernel", "3 values for 256 Gaussians"),
    ("ssim::ssim_mean_kernel", "two values a tile and channel"),
    ("ssim::loss", "two values"),
    ("sort::first_of_keys_kernel", "a bisection a tile or pixel"),
    ("sort::", "2,048 keys a cube, 8 a unit"),
    ("kernels::extra_count_kernel", "a number for each instant a tile of the image"),
    ("kernels::drawn_kernel", "a list for each instant a tile of the image"),
];

/// Burn's kernels that work on an element a unit: small launches have little work.
const BY_ELEMENT: [&str; 9] = [
    "binary::",
    "unary_float::",
    "unary_numeric::",
    "comparison::",
    "fill_device_dtype::",
    "slice",
    "cast",
    "concat",
    "mask",
];

/// Whether the launch may leave most of a GPU idle although its work grows with the scene.
fn is_serial(launch: &KernelLaunch) -> bool {
    let known = |names: &[&str]| names.iter().any(|name| launch.kernel.contains(name));
    let small = SMALL_WORK.map(|(name, _)| name);
    let units = if known(&OF_256_UNITS) { UNITS as u64 } else { UNITS_OF_A_CUBE };
    launch.cube_count() * units < UNITS_MIN && !known(&small) && !known(&BY_ELEMENT)
}

#[test]
fn a_step_has_few_launches_and_no_serial_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let recorder = LaunchRecorder::start(folder.path().join("launches.log")).expect("no GPU was opened before");
    let device = gs_burn::device::select(if cfg!(feature = "wgpu") { "wgpu" } else { "vulkan" }).expect("a GPU");
    let Command::Bench(args) = Cli::parse_from(["gsburn", "bench", "--gaussians", "100000"]).command else {
        unreachable!("the command is bench")
    };
    for (step, most, most_serial) in [
        ("density.strategy = mcmc", MOST, 0),
        ("density.strategy = default", MOST, 0),
        ("blur.mode = integrate", MOST_INTEGRATED, 0),
        ("blur.mode = warp", MOST_WARPED, SERIAL_WARPED),
    ] {
        let known = BENCH_STEPS.iter().find(|known| known.name.ends_with(step)).expect("a step of the benchmark");
        let mut take = (known.begin)(scene(&args, &device), &camera(&args, &device));
        // The first step makes the moments.
        take();
        let read_before = downloads();
        let launches = recorder.during(&device, take).expect("the log is read");
        let serial: Vec<&KernelLaunch> = launches.iter().filter(|launch| is_serial(launch)).collect();
        assert_eq!(downloads() - read_before, 0, "{step}: a step waits for a list");
        assert!((20..=most).contains(&launches.len()), "{step}: {} launches, at most {most}", launches.len());
        assert!(serial.len() <= most_serial, "{step}: at most {most_serial} serial launches: {serial:#?}");
    }
}
