//! Every kernel launch of a piece of work on a GPU: which, with how many cubes, for how long. A tool for development.
//!
//! A launch that runs on a few units is slow on any GPU and cannot be seen on a software one; the list shows it without
//! a GPU. CubeCL's profiling log is the source, because it is the only place where a launch of Burn's own kernels shows
//! its cubes.

use std::fs;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

use burn::tensor::Device;
use burn_cubecl::cubecl::config::profiling::ProfilingLogLevel;
use burn_cubecl::cubecl::config::{CubeClRuntimeConfig, RuntimeConfig};

/// The log counts as complete when it has not grown for this long after a synchronisation: its writer is a thread of
/// CubeCL's.
const QUIET: Duration = Duration::from_millis(300);

/// One launch.
#[derive(Debug, Clone, PartialEq)]
pub struct KernelLaunch {
    /// The kernel's function, as in `sort::sort_move_kernel`; Burn's kernels with their operation, as in
    /// `kernel_binop<MulOp>`.
    pub kernel: String,
    /// Cubes along three axes.
    pub cubes: [u32; 3],
    /// Time on the device, if it measured it. A software GPU measures too; its times say nothing of hardware.
    pub time: Option<Duration>,
}

impl KernelLaunch {
    /// Cubes in all.
    pub fn cube_count(&self) -> u64 {
        self.cubes.iter().map(|n| u64::from(*n)).product()
    }
}

/// A recorder of launches.
#[derive(Debug)]
pub struct LaunchRecorder {
    log: PathBuf,
}

impl LaunchRecorder {
    /// Records into the file `log`, which is overwritten. Every launch of the process is timed from now on, which slows
    /// it down.
    ///
    /// # Errors
    /// When a GPU was opened before, or the file cannot be written.
    pub fn start(log: PathBuf) -> io::Result<Self> {
        fs::write(&log, "")?;
        let mut config = CubeClRuntimeConfig::default();
        config.profiling.logger.level = ProfilingLogLevel::Full;
        config.profiling.logger.file = Some(log.clone());
        match CubeClRuntimeConfig::try_set(config) {
            true => Ok(Self { log }),
            false => Err(io::Error::other("launches must be recorded before a GPU is opened")),
        }
    }

    /// The launches of `work` on `device`, in order.
    ///
    /// # Errors
    /// When the log cannot be read, or the device fails.
    pub fn during(&self, device: &Device, work: impl FnOnce()) -> io::Result<Vec<KernelLaunch>> {
        self.settle(device)?;
        let before = fs::metadata(&self.log)?.len() as usize;
        work();
        self.settle(device)?;
        let log = fs::read(&self.log)?;
        Ok(parse(&String::from_utf8_lossy(log.get(before..).unwrap_or_default())))
    }

    fn settle(&self, device: &Device) -> io::Result<()> {
        device.sync().map_err(|error| io::Error::other(error.to_string()))?;
        let mut length = u64::MAX;
        loop {
            let now = fs::metadata(&self.log)?.len();
            if now == length {
                return Ok(());
            }
            length = now;
            std::thread::sleep(QUIET);
        }
    }
}

/// The launches in a log: `| 71.3µs | kernel: Options { .. } CubeCount (79, 1, 1)`, over several lines.
fn parse(log: &str) -> Vec<KernelLaunch> {
    let mut launches = Vec::new();
    let mut open: Option<(String, Option<Duration>)> = None;
    for line in log.lines() {
        if let Some((time, rest)) = line.strip_prefix("| ").and_then(|line| line.split_once('|')) {
            let time = time.trim();
            let measured = duration(time);
            // The lines of a summary begin with a name.
            if measured.is_some() || time == "not measured" {
                open = Some((short_name(rest.trim()), measured));
            }
        }
        let cubes = line.rsplit_once("CubeCount (").and_then(|(_, rest)| rest.split_once(')'));
        if let Some((cubes, _)) = cubes
            && let Some((kernel, time)) = open.take()
        {
            let mut axes = cubes.split(',').map(|n| n.trim().parse().unwrap_or(1));
            launches.push(KernelLaunch { kernel, cubes: std::array::from_fn(|_| axes.next().unwrap_or(1)), time });
        }
    }
    launches
}

/// A duration as Rust prints it for debugging.
fn duration(text: &str) -> Option<Duration> {
    let unit = text.find(|c: char| !c.is_ascii_digit() && c != '.')?;
    let seconds = match &text[unit..] {
        "ns" => 1e-9,
        "µs" => 1e-6,
        "ms" => 1e-3,
        "s" => 1.0,
        _ => return None,
    };
    Some(Duration::from_secs_f64(text[..unit].parse::<f64>().ok()? * seconds))
}

/// `gs_kernels::cube::sort::sort_move_kernel::SortMoveKernel: ..` as `sort::sort_move_kernel`: the last two modules,
/// and the last part of each type argument.
fn short_name(kernel: &str) -> String {
    let name = kernel.split(": ").next().unwrap_or(kernel);
    let (path, arguments) = name.split_once('<').map_or((name, ""), |(path, rest)| (path, rest.trim_end_matches('>')));
    let parts: Vec<&str> = path.split("::").collect();
    let modules = &parts[..parts.len().saturating_sub(1)];
    let own = modules[modules.len().saturating_sub(2)..].join("::");
    let of: Vec<&str> =
        arguments.split(',').filter_map(|path| path.rsplit("::").next()).filter(|s| !s.is_empty()).collect();
    if of.is_empty() { own } else { format!("{own}<{}>", of.join(",")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_becomes_launches() {
        let log = "\
| 71.3µs     | gs_kernels::cube::sort::sort_move_kernel::SortMoveKernel: SortMoveKernelInfo {
    keys: (),
} CubeCount (79, 2, 1)
| not measured | burn_cubecl::kernel::binary::kernel_binop::KernelBinop<burn_cubecl::kernel::binary::MulOp>: No info CubeCount (1, 1, 1)
|⎺⎺⎺⎺|
| Name | Duration | Num Computed | Ratio |
| gs_kernels::cube::sort::sort_move_kernel::SortMoveKernel: SortMoveKernelInfo { | 71.336µs | 1 | 0 % |
";
        let expected = [
            KernelLaunch {
                kernel: "sort::sort_move_kernel".into(),
                cubes: [79, 2, 1],
                time: Some(Duration::from_nanos(71_300)),
            },
            KernelLaunch { kernel: "binary::kernel_binop<MulOp>".into(), cubes: [1, 1, 1], time: None },
        ];
        assert_eq!(parse(log), expected);
        assert_eq!(expected[0].cube_count(), 158);
    }
}
