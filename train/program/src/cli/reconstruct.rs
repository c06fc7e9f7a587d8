//! Arguments of `reconstruct`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::ValueHint;
use gs_driving::RANGE_MAX;

use crate::cli::DeviceArgs;
use crate::cli::render::{finite, number};
use gs_pipelines::examples;

/// Arguments of `reconstruct`.
#[derive(Debug, Args)]
#[command(after_help = examples::RECONSTRUCT)]
pub struct ReconstructArgs {
    /// The driving log: a folder of PandaSet, Argoverse 2 or (with the feature `waymo`) Waymo
    #[arg(value_hint = ValueHint::DirPath)]
    pub log: PathBuf,

    /// The network: a run folder or a checkpoint (.safetensors) [default: one that ships with the program, trained on
    /// synthetic streets alone]
    #[arg(long, value_name = "RUN", value_hint = ValueHint::AnyPath)]
    pub model: Option<PathBuf>,

    /// Set one value of the network's configuration, as in --set lift.points=100000 or --set logs.camera=all
    /// (repeatable)
    #[arg(short, long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,

    /// Folder for images, actors, Gaussians and figures
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: PathBuf,

    /// First frame of the snippet
    #[arg(long, default_value_t = 0, value_name = "FRAME")]
    pub start: usize,

    /// The whole log by snippets that overlap, instead of one snippet
    #[arg(long, conflicts_with_all = ["start", "future"])]
    pub full: bool,

    /// Frames after the inputs to predict
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u8).range(0..=100), value_name = "N")]
    pub future: u8,

    /// Also render these times, seconds from the begin of the snippet (with --full of the first; each by the snippet
    /// that holds it)
    #[arg(long, value_delimiter = ',', allow_hyphen_values = true, value_parser = seconds, value_name = "T,...")]
    pub times: Vec<f64>,

    /// Optimise each snippet after the network, on its input images alone, by this many steps; Ctrl-C keeps what is
    /// reached
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=1_000_000), value_name = "STEPS")]
    pub polish: u32,

    /// Move the cameras forward, left and up, metres
    #[arg(long, default_value = "0,0,0", allow_hyphen_values = true, value_parser = shift, value_name = "F,L,U")]
    pub shift: Shift,

    /// Gaussians slower than this carry no motion, metres per second
    #[arg(long = "static", value_parser = not_negative, value_name = "SPEED")]
    pub rest_speed: Option<f64>,

    /// Remove, insert, move or recolour actors by this script (TOML)
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub edit: Option<PathBuf>,

    /// Device
    #[command(flatten)]
    pub device: DeviceArgs,
}

/// Forward, left, up, metres.
#[derive(Debug, Clone, Copy)]
pub struct Shift(pub [f64; 3]);

/// Farthest time from the begin of a snippet, seconds: no log lasts an hour.
const SECONDS_MAX: f64 = 3600.0;

fn seconds(text: &str) -> Result<f64, String> {
    number(text, |x| x.abs() <= SECONDS_MAX, &format!("expected seconds from -{SECONDS_MAX} to {SECONDS_MAX}"))
}

fn not_negative(text: &str) -> Result<f64, String> {
    number(text, |x| x >= 0.0, "expected a number of at least 0")
}

fn shift(text: &str) -> Result<Shift, String> {
    let near = |part: &str| finite(part.trim()).ok().filter(|x| x.abs() <= RANGE_MAX);
    let numbers: Option<Vec<f64>> = text.split(',').map(near).collect();
    match numbers.as_deref() {
        Some(&[forward, left, up]) => Ok(Shift([forward, left, up])),
        // What lies farther away no LiDAR sees.
        _ => Err(format!("expected three numbers from -{RANGE_MAX} to {RANGE_MAX}, as in 0,1.5,0.5")),
    }
}
