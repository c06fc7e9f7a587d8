//! Arguments exactly as typed.

mod chart;
mod sweep;

pub use chart::ChartArgs;
pub use sweep::SweepArgs;

use std::path::PathBuf;

use clap::builder::ValueHint;
use clap::{ArgAction, Args, Parser, Subcommand, ValueEnum};

const EXAMPLES: &str = "\
Examples:
  gsburn demo                                       blurry video to a sharp moving scene on the CPU, with a report
  gsburn check my-photos                            what is in a data set, and what is wrong with it
  gsburn train my-photos --set data.max_width=800   photos with poses (COLMAP or transforms.json) to Gaussians
  gsburn train --resume --out runs/my-photos        continue after Ctrl-C or a power cut
  gsburn synth deblur sphere --out sphere           blurry multi-view video with known truth
  gsburn train sphere --config configs/taylormode/base.toml
  gsburn render runs/my-photos --cameras path/transforms.json --out frames
  gsburn export runs/my-photos --out scene.ply";

/// Gaussian splatting with Burn: posed photos or blurry video in, a scene you can render, measure and export out.
#[derive(Debug, Parser)]
#[command(name = "gsburn", version, after_help = EXAMPLES, max_term_width = 110)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,

    /// Say more about what happens: -v decisions, -vv every change, -vvv everything
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
    /// Render a scene along the cameras of a transforms.json
    Render(RenderArgs),
    /// Write a trained scene as PLY for other viewers
    Export(ExportArgs),
    /// Make a data set whose ground truth is known, or blur a sharp one
    Synth(SynthArgs),
    /// Say what is in a data set and what is wrong with it
    Check(CheckArgs),
    /// Show versions, features and devices, or what is in a scene file
    Info(InfoArgs),
    /// Time every operation and a whole training step on a synthetic scene
    Bench(BenchArgs),
    /// Make blurry video of a small world, train a sharp moving scene from it on the CPU and write a report
    Demo(DemoArgs),
    /// Chart accuracy against seconds and count of several runs, with the Pareto front
    Chart(ChartArgs),
    /// Train one run for every combination of some values and chart them
    Sweep(SweepArgs),
    /// Run experiments at the edge of a method and draw where it fails
    Stability(StabilityArgs),
}

/// Where to compute.
#[derive(Debug, Clone, Args)]
pub struct DeviceArgs {
    /// Where to compute: auto, flex, ndarray, wgpu, vulkan, metal or cuda, with an index as in cuda:1
    #[arg(long, default_value = "auto", value_name = "DEVICE")]
    pub device: String,
}

/// Configuration: a file and single values.
#[derive(Debug, Clone, Default, Args)]
pub struct ConfigArgs {
    /// Configuration file (TOML); it may name a `base` file and then holds only what differs
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub config: Option<PathBuf>,

    /// Set one value, as in --set density.cap=50000 (repeatable; see config.toml of any run for all keys)
    #[arg(short, long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

const TRAIN_EXAMPLES: &str = "\
Examples:
  gsburn train my-photos                                  defaults: 7000 steps, at most 100 000 Gaussians
  gsburn train my-photos --config configs/static/fox.toml
  gsburn train my-photos --steps 1000 --cap 50000 --set data.max_width=480
  gsburn train my-photos --set data.holdout=names --set 'data.holdout_names=[\"DSC_0007\"]'
  gsburn train --resume --out runs/my-photos

A run is a folder: config.toml, metrics.jsonl, checkpoints/, eval.json, renders/, plots/, scene.ply and report.html.
Ctrl-C saves a checkpoint and leaves with exit code 130; --resume continues where it stopped.";

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

    /// Gaussians at most (as --set density.cap=N)
    #[arg(long, value_name = "N")]
    pub cap: Option<usize>,

    /// Seed of all random draws (as --set seed=N)
    #[arg(long, value_name = "N")]
    pub seed: Option<u64>,

    /// Run folder [default: runs/NAME after the data set, numbered if there is one]
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: Option<PathBuf>,

    /// Continue the run in --out (or the newest run of the data set) from its newest checkpoint
    #[arg(long)]
    pub resume: bool,

    /// Show no progress
    #[arg(short, long)]
    pub quiet: bool,

    /// Measure where the time of a step goes: a table at the end, profile.json, and bars in the report (on a GPU each stage
    /// waits for the device, so steps are slower)
    #[arg(long)]
    pub profile: bool,

    /// Device
    #[command(flatten)]
    pub device: DeviceArgs,
}

/// Arguments of `eval`.
#[derive(Debug, Args)]
pub struct EvalArgs {
    /// A run folder, a checkpoint (.safetensors) or a scene (.ply)
    #[arg(value_hint = ValueHint::AnyPath)]
    pub scene: PathBuf,

    /// The data set with the held-out views [default: the one of the run]
    #[arg(long, value_name = "DATASET", value_hint = ValueHint::AnyPath)]
    pub data: Option<PathBuf>,

    /// Configuration for a .ply (how to read the data set, how to render); a run has its own
    #[command(flatten)]
    pub config: ConfigArgs,

    /// Also write the figures of every view to this JSON file
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub out: Option<PathBuf>,

    /// Also write photo, rendering and error of every view into this folder
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub renders: Option<PathBuf>,

    /// Device
    #[command(flatten)]
    pub device: DeviceArgs,
}

/// What `render` writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ImageFormat {
    /// NAME.png (8-bit colour), NAME_depth.png (16-bit, 1/1000 scene unit, 0 = nothing there) and NAME_alpha.png (8-bit)
    Png,
    /// NAME.exr with 32-bit channels R, G, B (as trained, not converted to linear light), A, and Z (scene units)
    Exr,
}

/// Arguments of `render`.
#[derive(Debug, Args)]
pub struct RenderArgs {
    /// A run folder, a checkpoint (.safetensors) or a scene (.ply)
    #[arg(value_hint = ValueHint::AnyPath)]
    pub scene: PathBuf,

    /// Cameras: a transforms.json (its images need not exist); images are named after its frames
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub cameras: PathBuf,

    /// Folder for the images
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: PathBuf,

    /// File format
    #[arg(long, value_enum, default_value_t = ImageFormat::Png)]
    pub format: ImageFormat,

    /// A moving scene's time, in its data set's unit [default: each camera's own, or the middle of the recording]
    #[arg(long, value_name = "T", allow_negative_numbers = true, conflicts_with = "frames")]
    pub time: Option<f64>,

    /// Every camera at N times spread over the recording; images are numbered, ready for a video encoder
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub frames: Option<u32>,

    /// With --frames: also an animated GIF per camera
    #[arg(long, requires = "frames")]
    pub gif: bool,

    /// Also depth in colour (near bright, far dark) and, of a moving scene, velocity in colour (grey stands still; red,
    /// green and blue are the world's axes)
    #[arg(long)]
    pub maps: bool,

    /// Use SH only up to this degree [default: all that is stored]
    #[arg(long, value_name = "0..3", value_parser = clap::value_parser!(u8).range(0..=3))]
    pub sh_degree: Option<u8>,

    /// Background colour: black, white or r,g,b from 0 to 1 [default: the run's, or black]
    #[arg(long, value_name = "COLOR")]
    pub background: Option<String>,

    /// Undo the brightening of small Gaussians (for scenes trained with render.antialiased) [default: the run's]
    #[arg(long)]
    pub antialiased: bool,

    /// Device
    #[command(flatten)]
    pub device: DeviceArgs,
}

/// Arguments of `export`.
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// A run folder, a checkpoint (.safetensors) or a scene (.ply)
    #[arg(value_hint = ValueHint::AnyPath)]
    pub scene: PathBuf,

    /// The PLY file to write (3DGS layout, in the data set's own world)
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub out: PathBuf,

    /// A moving scene's time, in its data set's unit [default: the middle of the recording]
    #[arg(long, value_name = "T", allow_negative_numbers = true, conflicts_with = "frames")]
    pub time: Option<f64>,

    /// One file for each of N times spread over the recording, numbered
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub frames: Option<u32>,

    /// Leave out nearly transparent, oversized and isolated Gaussians
    #[arg(long)]
    pub no_floaters: bool,

    /// Keep SH only up to this degree
    #[arg(long, value_name = "0..3", value_parser = clap::value_parser!(u8).range(0..=3))]
    pub sh_degree: Option<u8>,
}

/// Arguments of `check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// The data set
    #[arg(value_hint = ValueHint::AnyPath)]
    pub dataset: PathBuf,

    /// How it would be read
    #[command(flatten)]
    pub config: ConfigArgs,
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

    /// Photos of a scene that stands still instead of blurry video
    #[arg(long)]
    pub still: bool,

    /// Steps; fewer for a quick look
    #[arg(long, value_name = "N")]
    pub steps: Option<usize>,

    /// Show no progress
    #[arg(short, long)]
    pub quiet: bool,

    /// Device; the CPU is fast enough for this scene
    #[command(flatten)]
    pub device: DeviceArgs,
}

/// Arguments of `synth`.
#[derive(Debug, Args)]
pub struct SynthArgs {
    /// What to make
    #[command(subcommand)]
    pub what: Synth,
}

/// What `synth` makes.
#[derive(Debug, Subcommand)]
pub enum Synth {
    /// Motion-blurred multi-view video of a small world, ray traced, with sharp images, masks, depth, velocity and priors
    Deblur(SynthDeblurArgs),
    /// A blurry data set from a sharp one: consecutive frames of each camera averaged in linear light
    BlurFromFrames(BlurFromFramesArgs),
}

/// Arguments of `synth deblur`.
#[derive(Debug, Args)]
pub struct SynthDeblurArgs {
    /// cube (slides and turns), lychee (spins), monkey (speeds up) or sphere (bounces)
    #[arg(value_enum)]
    pub world: WorldName,

    /// Folder to write
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: PathBuf,

    /// Image size, pixels
    #[arg(long, default_value = "256x192", value_name = "WxH")]
    pub size: String,

    /// Cameras on the arc, held-out ones included
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u32).range(2..=200), value_name = "N")]
    pub cameras: u32,

    /// Cameras held out
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100), value_name = "N")]
    pub held_out: u32,

    /// Frames of each camera
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=1000), value_name = "N")]
    pub frames: u32,

    /// Moments that each blurry frame is averaged over
    #[arg(long, default_value_t = 32, value_parser = clap::value_parser!(u32).range(16..=4096), value_name = "N")]
    pub subframes: u32,

    /// How long the shutter is open, in frame intervals
    #[arg(long, default_value_t = 0.9, value_name = "SHARE")]
    pub exposure: f64,

    /// Factor of all speeds
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR")]
    pub speed: f64,

    /// Write the priors (depth, masks, pseudo-sharp photos) without faults
    #[arg(long)]
    pub perfect_priors: bool,

    /// Points to start from, noisy ones on surfaces; 0: none
    #[arg(long, default_value_t = 4000, value_name = "N")]
    pub points: usize,

    /// Seed of textures, still bodies and faults
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub seed: u64,
}

/// A synthetic world.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum WorldName {
    /// A box slides and turns
    Cube,
    /// A bumpy fruit spins
    Lychee,
    /// A head of several parts speeds up
    Monkey,
    /// A ball bounces
    Sphere,
}

/// Arguments of `synth blur-from-frames`.
#[derive(Debug, Args)]
pub struct BlurFromFramesArgs {
    /// A data set with times and cameras that stand still
    #[arg(value_hint = ValueHint::AnyPath)]
    pub dataset: PathBuf,

    /// Folder to write
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: PathBuf,

    /// Frames averaged into one, an odd number
    #[arg(long, default_value_t = 5, value_name = "N")]
    pub window: usize,

    /// Frames from one blurry frame to the next; below the window exposures overlap
    #[arg(long, default_value_t = 5, value_name = "N")]
    pub stride: usize,

    /// The data set's masks show what moves in white: keep them as priors and for measuring
    #[arg(long)]
    pub moving_masks: bool,

    /// Downscale to this width first, pixels
    #[arg(long, value_name = "PIXELS")]
    pub max_width: Option<usize>,
}

/// Arguments of `stability`.
#[derive(Debug, Args)]
pub struct StabilityArgs {
    /// The method
    #[command(subcommand)]
    pub what: Stability,
}

/// Methods whose limits `stability` looks for.
#[derive(Debug, Subcommand)]
pub enum Stability {
    /// TaylorMoDe-GS: blur and motion, exposure, Taylor paths, depth priors, masks, opacities
    Taylormode(StabilityTaylormodeArgs),
}

const STABILITY_EXAMPLES: &str = "\
Examples:
  gsburn stability taylormode --out runs/stability
  gsburn stability taylormode --out runs/stability --only divergence,direction
  gsburn stability taylormode --out runs/look --quick

Writes a figure (SVG) per experiment, results.json and stability.html, which needs no other file. A bound that is missed is
shown as missed and is no error.";

/// Arguments of `stability taylormode`.
#[derive(Debug, Args)]
#[command(after_help = STABILITY_EXAMPLES)]
pub struct StabilityTaylormodeArgs {
    /// Folder for the small worlds, the figures and the report
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: PathBuf,

    /// Only these experiments: divergence, thrown, samples, direction, exposure, absorb, depth, masks, speed, opacity
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub only: Vec<String>,

    /// Fewer variants and steps: a look, not a measurement
    #[arg(long)]
    pub quick: bool,

    /// Device
    #[command(flatten)]
    pub device: DeviceArgs,
}
