//! One file per command: from arguments to what the program needs, call, print.

pub mod bench;
pub mod chart;
pub mod check;
pub mod demo;
pub mod eval;
pub mod export;
pub mod info;
pub mod recipes;
pub mod render;
pub mod stability;
pub mod sweep;
pub mod synth;
pub mod train;

use std::io::Write;

use anyhow::Result;
use burn::tensor::Device;

use crate::cli::DeviceArgs;

/// The device that was asked for, without autodiff.
fn device(args: &DeviceArgs) -> Result<Device> {
    Ok(gs_burn::device::select(&args.device)?)
}

/// A device in words: its backend and, for a GPU, its name.
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

/// The command as it was typed, for figures that name it; words that a shell would take apart are quoted.
fn command_line() -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_=./,:+@%".contains(c);
    let quoted = std::env::args().skip(1).map(|word| match !word.is_empty() && word.chars().all(plain) {
        true => word,
        false => format!("'{}'", word.replace('\'', r"'\''")),
    });
    std::iter::once("gsburn".to_string()).chain(quoted).collect::<Vec<_>>().join(" ")
}

/// Prints to stdout. A reader that left (`gsburn info | head -1`) is no error.
fn print(text: impl std::fmt::Display) {
    // Stdout is where results go; when it is gone there is nobody left to tell.
    let _ = writeln!(std::io::stdout(), "{text}");
}
