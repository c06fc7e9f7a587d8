//! Arguments exactly as typed. A command with many arguments has a file of its own.

mod export;
mod extrapolate;
mod flow;
mod import;
mod reconstruct;
mod render;
mod synth;
mod view;

mod sweep;

pub use export::{ConvertArgs, ExportArgs, Up};
pub use extrapolate::ExtrapolateArgs;
pub use flow::{FlowArgs, ScoredPoints};
pub use sweep::SweepArgs;

use std::path::PathBuf;

use clap::builder::ValueHint;
use clap::{ArgAction, Args, Parser, Subcommand};

use gs_pipelines::examples;

pub use import::ImportArgs;
pub use reconstruct::ReconstructArgs;
pub use render::{ImageFormat, RenderArgs};
pub use synth::{
    BlurFromFramesArgs, Synth, SynthArgs, SynthDeblurArgs, SynthDrivingArgs, SynthExtrapolationArgs, SynthStillArgs,
};
pub use view::{ViewArgs, WatchArgs};

/// Gaussian splatting with Burn: posed photos or blurry video in, a scene you can render, measure and export out.
#[derive(Debug, Parser)]
#[command(name = "gsburn", version, after_help = examples::PROGRAM, max_term_width = 110)]
pub struct Cli {
    /// The command.
    #[command(subcommand)]
    pub command: Command,

    /// Log more: -v decisions, -vv every change, -vvv everything
    #[arg(short, long, action = ArgAction::Count, global = true)]
    pub verbose: u8,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Train a scene from posed photos
    Train(TrainArgs),
    /// Measure a trained scene on held-out photos
    Eval(EvalArgs),
    /// Turn a driving log into moving Gaussians with a trained network: images at any time, actors, scene flow
    Reconstruct(ReconstructArgs),
    /// Find the scene flow of a driving log from its LiDAR sweeps alone, and score it where there are labels
    Flow(FlowArgs),
    /// Render a scene along the cameras of a data set, or along a path: orbit, spiral, key frames
    Render(RenderArgs),
    /// Write one page that shows a scene in a browser, in three dimensions and through time
    View(ViewArgs),
    /// Show a run in a browser while it trains: its newest checkpoint and its curves
    Watch(WatchArgs),
    /// Write a trained scene for other viewers: PLY, SPZ, glTF or OpenUSD
    Export(ExportArgs),
    /// Turn a file of Gaussians into another: PLY, SPZ, glTF, OpenUSD
    Convert(ConvertArgs),
    /// Predict frames after a recording, with paths, maps, rigid parts and uncertainty
    Extrapolate(Box<ExtrapolateArgs>),
    /// Make a data set whose ground truth is known, or blur a sharp one
    Synth(SynthArgs),
    /// Fit depth files of a network to the points of a data set, as priors
    Import(ImportArgs),
    /// Report contents and mistakes of a data set
    Check(CheckArgs),
    /// Show versions, features and devices, or the contents of a scene file
    Info(InfoArgs),
    /// Time every operation and a whole training step on a synthetic scene
    Bench(BenchArgs),
    /// Make blurry video of a small world, train a sharp moving scene from it on the CPU and write a report
    Demo(DemoArgs),
    /// Train one run for every combination of some values and chart them
    Sweep(SweepArgs),
    /// List the training recipes that are compiled in
    Recipes,
}

/// The compute device.
#[derive(Debug, Clone, Args)]
pub struct DeviceArgs {
    /// Compute device: auto (the best GPU of this build, never a software one, else the CPU), flex, ndarray, wgpu,
    /// vulkan, metal or cuda, with an index as in cuda:1
    #[arg(long, default_value = "auto", value_name = "DEVICE")]
    pub device: String,
}

/// Configuration: a file and single values.
#[derive(Debug, Clone, Default, Args)]
pub struct ConfigArgs {
    /// Configuration file (TOML); it may name a `base` file and then holds only the differences
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub config: Option<PathBuf>,

    /// A compiled-in recipe by its name (`gsburn recipes` lists them)
    #[arg(long, value_name = "NAME", conflicts_with = "config")]
    pub recipe: Option<String>,

    /// Set one value, as in --set density.cap=50000 (repeatable; config.toml of any run has all keys)
    #[arg(short, long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

impl ConfigArgs {
    /// Whether any of them was given.
    pub fn is_typed(&self) -> bool {
        self.config.is_some() || self.recipe.is_some() || !self.set.is_empty()
    }
}

const TRAIN_EXAMPLES: &str = "\
Examples:
  gsburn train my-photos                                  defaults: 7000 steps, at most 100 000 Gaussians
  gsburn train my-photos --recipe static/fox
  gsburn train my-photos --steps 1000 --cap 50000 --set data.max_width=480
  gsburn train my-photos --set data.holdout=names --set 'data.holdout_names=[\"DSC_0007\"]'
  gsburn train --resume --out runs/my-photos

A run is a folder: config.toml, metrics.jsonl, checkpoints/, eval.json, renders/, plots/, scene.ply and report.html.
Ctrl-C saves a checkpoint and leaves with exit code 130, SIGTERM likewise with 143; --resume continues where it stopped.";

/// Arguments of `train`.
#[derive(Debug, Args)]
#[command(after_help = TRAIN_EXAMPLES)]
pub struct TrainArgs {
    /// The data set: a folder with a COLMAP model or a transforms.json, or the file itself
    #[arg(required_unless_present = "resume", value_hint = ValueHint::AnyPath)]
    pub dataset: Option<PathBuf>,

    /// Configuration
    #[command(flatten)]
    pub config: ConfigArgs,

    /// Steps (as --set steps=N)
    #[arg(long, value_name = "N")]
    pub steps: Option<usize>,

    /// Steps, at most a million, by a budget of time, reading and evaluation at the end apart: processor time on a CPU,
    /// the clock on a GPU. A few steps are measured first; the plan is saved in config.toml
    #[arg(long, value_name = "M", value_parser = extrapolate::positive, conflicts_with_all = ["steps", "resume"])]
    pub minutes: Option<f64>,

    /// Gaussians at most (as --set density.cap=N)
    #[arg(long, value_name = "N")]
    pub cap: Option<usize>,

    /// Seed of all random draws (as --set seed=N)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(..=i64::MAX as u64))]
    pub seed: Option<u64>,

    /// Run folder [default: runs/NAME after the data set; runs/NAME-2, -3, ... if that exists]
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: Option<PathBuf>,

    /// Continue the run in --out (or the newest run of the data set) from its newest checkpoint
    #[arg(long)]
    pub resume: bool,

    /// Show no progress
    #[arg(short, long)]
    pub quiet: bool,

    /// Measure the time of each stage of a step: a table at the end, profile.json, and bars in the report (on a GPU
    /// each stage waits for the device, so steps are slower)
    #[arg(long)]
    pub profile: bool,

    /// Device
    #[command(flatten)]
    pub device: DeviceArgs,

    /// Devices that share a step, for networks that are trained on many logs: --device and the ones after it of the
    /// same kind; on the CPU as many workers
    #[arg(long, value_name = "N", default_value = "1", value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..))]
    pub devices: usize,
}

/// Arguments of `eval`.
#[derive(Debug, Args)]
pub struct EvalArgs {
    /// A run folder, a checkpoint (.safetensors) or a scene (.ply)
    #[arg(value_hint = ValueHint::AnyPath)]
    pub scene: PathBuf,

    /// The data set with the held-out views [default: that of the run]
    #[arg(long, value_name = "DATASET", value_hint = ValueHint::AnyPath)]
    pub data: Option<PathBuf>,

    /// Configuration for a .ply (how to read the data set, how to render); a run has its own, of which --set changes
    /// single values
    #[command(flatten)]
    pub config: ConfigArgs,

    /// The split to measure: test, validation, train or another name of the data set [default: test, else validation]
    #[arg(long, value_name = "NAME")]
    pub split: Option<String>,

    /// Also write the scores of every view to this JSON file
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub out: Option<PathBuf>,

    /// Also write photo, rendering and error of every view into this folder
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub renders: Option<PathBuf>,

    /// Device
    #[command(flatten)]
    pub device: DeviceArgs,
}

/// Arguments of `check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// The data set: photos, a driving log, or a folder of driving logs
    #[arg(value_hint = ValueHint::AnyPath)]
    pub dataset: PathBuf,

    /// Configuration for reading it
    #[command(flatten)]
    pub config: ConfigArgs,

    /// Draw the LiDAR of a driving log into its images, in this folder
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub pictures: Option<PathBuf>,
}

/// Arguments of `info`.
#[derive(Debug, Args)]
pub struct InfoArgs {
    /// A run folder, a checkpoint (.safetensors) or a scene (.ply); without it, the program itself
    #[arg(value_hint = ValueHint::AnyPath)]
    pub scene: Option<PathBuf>,
}

/// Arguments of `bench`.
#[derive(Debug, Args)]
pub struct BenchArgs {
    /// Gaussians
    #[arg(long, default_value_t = 100_000, value_name = "N")]
    pub gaussians: usize,

    /// Image width, pixels
    #[arg(long, default_value_t = 640, value_parser = clap::value_parser!(u32).range(1..=16_384))]
    pub width: u32,

    /// Image height, pixels
    #[arg(long, default_value_t = 480, value_parser = clap::value_parser!(u32).range(1..=16_384))]
    pub height: u32,

    /// SH degree
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u8).range(0..=3))]
    pub sh_degree: u8,

    /// Repetitions; the median is shown
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub repeat: u32,

    /// Device
    #[command(flatten)]
    pub device: DeviceArgs,
}

/// Arguments of `demo`.
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Folder for the scene and the run [default: runs/demo, numbered if there is one]
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: Option<PathBuf>,

    /// Photos of a static scene instead of blurry video
    #[arg(long)]
    pub still: bool,

    /// A driving log instead: it is reconstructed by the network that ships with the program, without a training
    #[arg(long, conflicts_with_all = ["still", "steps"])]
    pub driving: bool,

    /// Steps; fewer for a quick look
    #[arg(long, value_name = "N")]
    pub steps: Option<usize>,

    /// Show no progress
    #[arg(short, long)]
    pub quiet: bool,

    /// Device; a CPU is fast enough for this scene
    #[command(flatten)]
    pub device: DeviceArgs,
}
