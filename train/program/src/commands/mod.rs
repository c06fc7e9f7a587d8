//! One file per command: convert the arguments, call, print.

pub mod bench;
pub mod check;
pub mod choose;
mod combinations;
pub mod convert;
pub mod demo;
pub mod eval;
pub mod export;
pub mod extrapolate;
pub mod flow;
pub mod import;
pub mod info;
mod planned;
pub mod recipes;
pub mod reconstruct;
pub mod render;
pub mod sweep;
pub mod synth;
pub mod train;
pub mod view;
pub mod watch;

use std::fs::File;
use std::io::{ErrorKind, Write};
use std::sync::OnceLock;

use anyhow::{Result, bail};
use burn::tensor::Device;
use gs_base::printable;

use crate::cli::DeviceArgs;
use gs_train::run::measured::Quality;
use gs_train::run::metrics::NO_LPIPS;

/// The device named by the arguments, without autodiff. In a build with a GPU backend it says on standard error what
/// `auto` took, and why: the wrong choice costs hours.
fn device(args: &DeviceArgs) -> Result<Device> {
    let selected = gs_burn::device::select_explained(&args.device)?;
    if let Some(why) = selected.why {
        eprintln!("{}", printable(&why));
    }
    Ok(selected.device)
}

/// A device for people: its backend and, for a GPU, its name.
pub fn describe(device: &Device) -> String {
    // Burn shows a device as `Device<Flex(Cpu)>`.
    let shown = format!("{device:?}").to_lowercase();
    let shown = shown.trim_start_matches("device<").trim_end_matches('>');
    #[cfg(any(feature = "wgpu", feature = "vulkan", feature = "metal", feature = "cuda"))]
    if let Some(identity) = device.identity() {
        return format!("{shown}: {}", identity.name);
    }
    shown.strip_suffix("(cpu)").map_or(shown.to_owned(), |backend| format!("{backend}, on the CPU"))
}

/// Why standard output did not take a result.
static LOST: OnceLock<String> = OnceLock::new();

/// Prints to stdout, where results go. A reader that left (`gsburn info | head -1`) is no error; what else fails is one
/// at the end, after the files of the command were written.
fn print(text: impl std::fmt::Display) {
    let text = text.to_string();
    let lines: Vec<_> = text.split('\n').map(printable).collect();
    let mut stdout = std::io::stdout();
    let written = writeln!(stdout, "{}", lines.join("\n")).and_then(|()| stdout.flush());
    if let Err(error) = written
        && error.kind() != ErrorKind::BrokenPipe
    {
        LOST.get_or_init(|| error.to_string());
    }
}

/// Checks that everything printed has arrived.
///
/// # Errors
/// A sentence, when standard output did not take it (a full disk).
pub fn all_printed() -> Result<()> {
    LOST.get().map_or(Ok(()), |error| bail!("standard output: cannot write: {error}"))
}

/// Why figures are missing. What is missing for every run of this machine (the weights of LPIPS) is said once per
/// machine.
fn missing(quality: &Quality) -> Vec<&str> {
    let once = |reason: &&str| !reason.starts_with(NO_LPIPS) || is_news(reason);
    let reasons = [&quality.ms_ssim_reason, &quality.lpips_reason].into_iter().flatten();
    reasons.map(String::as_str).filter(once).collect()
}

/// Whether a sentence is said for the first time on this machine. An empty file in the user's cache remembers it.
fn is_news(sentence: &str) -> bool {
    let Some(folder) = dirs::cache_dir().map(|cache| cache.join("gsburn")) else { return true };
    let mark = folder.join(format!("said-{:08x}", crc32fast::hash(sentence.as_bytes())));
    let made = std::fs::create_dir_all(&folder).and_then(|()| File::create_new(mark));
    !made.is_err_and(|error| error.kind() == ErrorKind::AlreadyExists)
}
