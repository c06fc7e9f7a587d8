//! `gsburn bench --launches`: every kernel launch of one training step, on a GPU or a software one.

use std::process::ExitCode;

use anyhow::Result;

use crate::cli::BenchArgs;

/// Without a GPU backend there is nothing to list.
#[cfg(not(any(feature = "wgpu", feature = "vulkan", feature = "metal", feature = "cuda")))]
pub fn run(_args: &BenchArgs) -> Result<ExitCode> {
    anyhow::bail!("--launches lists the kernels of a GPU: build with --features wgpu, vulkan, metal or cuda")
}

#[cfg(any(feature = "wgpu", feature = "vulkan", feature = "metal", feature = "cuda"))]
pub use recorded::run;

#[cfg(any(feature = "wgpu", feature = "vulkan", feature = "metal", feature = "cuda"))]
mod recorded {
    use std::collections::BTreeMap;
    use std::time::Duration;

    use anyhow::{Context, ensure};
    use gs_burn::launches::{KernelLaunch, LaunchRecorder};
    use gs_kernels::cube::buffer::downloads;

    use super::*;
    use crate::commands::bench::{camera, scene};
    use crate::commands::{describe, device, print};
    use gs_pipelines::bench::{BENCH_STEPS, BenchStep};

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
        let units = if known(&OF_256_UNITS) { gs_kernels::cube::buffer::UNITS as u64 } else { UNITS_OF_A_CUBE };
        launch.cube_count() * units < UNITS_MIN && !known(&small) && !known(&BY_ELEMENT)
    }

    /// Prints the launches of a step of each kind.
    ///
    /// # Errors
    /// When the device is not there, is a CPU or cannot be recorded.
    pub fn run(args: &BenchArgs) -> Result<ExitCode> {
        let log = std::env::temp_dir().join(format!("gsburn-launches-{}.log", std::process::id()));
        let recorder = LaunchRecorder::start(log.clone()).with_context(|| format!("recording in {}", log.display()))?;
        let device = device(&args.device)?;
        ensure!(device.identity().is_some(), "--launches lists the kernels of a GPU: give one with --device");
        print(format!("{} Gaussians, {}x{}, {}", args.gaussians, args.width, args.height, describe(&device)));
        for BenchStep { name, begin } in &BENCH_STEPS {
            let mut step = begin(scene(args, &device), &camera(args, &device));
            // The first step makes the moments.
            step();
            let read_before = downloads();
            let launches = recorder.during(&device, step)?;
            table(name, &launches, downloads() - read_before);
        }
        // The log is the process's own; a copy that stays would only fill the folder.
        let _ = std::fs::remove_file(&log);
        Ok(ExitCode::SUCCESS)
    }

    fn table(name: &str, launches: &[KernelLaunch], waits: usize) {
        struct Row {
            count: usize,
            fewest: u64,
            most: u64,
            time: Duration,
        }
        let mut rows: BTreeMap<&str, Row> = BTreeMap::new();
        for launch in launches {
            let none = Row { count: 0, fewest: u64::MAX, most: 0, time: Duration::ZERO };
            let row = rows.entry(&launch.kernel).or_insert(none);
            row.count += 1;
            row.fewest = row.fewest.min(launch.cube_count());
            row.most = row.most.max(launch.cube_count());
            row.time += launch.time.unwrap_or_default();
        }
        let serial = launches.iter().filter(|launch| is_serial(launch)).count();
        print(format!("\n{name}: {} launches, {serial} serial, {waits} waits for lists", launches.len()));
        print(format!("{:52} {:>8} {:>12} {:>12} {:>10}", "kernel", "launches", "fewest cubes", "most cubes", "ms"));
        let mut rows: Vec<_> = rows.into_iter().collect();
        rows.sort_by_key(|(_, row)| std::cmp::Reverse(row.time));
        for (kernel, row) in rows {
            let time = row.time.as_secs_f64() * 1e3;
            print(format!("{kernel:52} {:>8} {:>12} {:>12} {time:>10.3}", row.count, row.fewest, row.most));
        }
        for launch in launches.iter().filter(|launch| is_serial(launch)) {
            print(format!("serial: {} with {} cubes", launch.kernel, launch.cube_count()));
        }
    }
}
