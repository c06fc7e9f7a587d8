//! Arguments of `gsburn extrapolate`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::ValueHint;

use crate::cli::DeviceArgs;
use crate::cli::render::{finite, number};
use crate::report::future::spread::FEWEST;

/// Most members of an ensemble: each is integrated over all times, and the spread of a thousand is known to 3 %.
const MEMBERS_MAX: u32 = 1000;

const EXAMPLES: &str = "\
Examples:
  gsburn extrapolate runs/fan --to 1.5                    frames, paths, maps and figures
  gsburn extrapolate runs/fan --to 1.5 --camera orbit     a camera that goes around what moves
  gsburn extrapolate runs/fan --to 1.5 --ply --bodies     a PLY for each time and each rigid part
  gsburn extrapolate runs/fan --to 1.0 --step 4           integration steps of 4 frames
  gsburn extrapolate runs/fan --to 1.5 --from 0 --fps 30  past and future

Written into the folder:
  frames/CAMERA_0000.png ..., CAMERA.gif  predicted frames
  trajectories.png                        paths: seen in blue, the future from orange to red
  speed.png, velocity.png,                maps at --from; grey is at rest, red, green and blue are
  angular_velocity.png                    the world's axes
  uncertainty.png                         spread of the ensemble at --to, yellow the largest
  psnr_over_time.svg, strip.png           against photos of later times, where there are any
  calibration.svg                         spread against true error, where the truth is known
  ply/, bodies/                           with --ply and --bodies
  extrapolate.json                        every number, with the full scale of each map

Gain over held is the PSNR of the prediction less that of the scene as it was at the last time
seen: a method that learned no motion has 0. The run's report gets a section \"Future\", unless
--step is given. A law holds for as long as nothing new acts, a contact for instance.";

/// Arguments of `extrapolate`.
#[derive(Debug, Args)]
#[command(after_help = EXAMPLES)]
pub struct ExtrapolateArgs {
    /// A run folder, or a checkpoint (.safetensors) with --out
    #[arg(value_hint = ValueHint::AnyPath)]
    pub run: PathBuf,

    /// Last time, in the data set's unit; after the last that was seen
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite)]
    pub to: f64,

    /// Time of the first frame [default: the last that was seen]
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite)]
    pub from: Option<f64>,

    /// Frames, the first at --from and the last at --to [default: at the distance of the recording's]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=10_000), conflicts_with = "fps")]
    pub frames: Option<u32>,

    /// Frames per unit of time
    #[arg(long, value_name = "F", value_parser = positive)]
    pub fps: Option<f64>,

    /// A camera of the data set by its id or by the name of one of its views, or `orbit` (repeatable) [default: the
    /// first that is held out]
    #[arg(long, value_name = "NAME")]
    pub camera: Vec<String>,

    /// Folder for the results [default: RUN/extrapolate]
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: Option<PathBuf>,

    /// Also a PLY for the time of each frame: ply/RUN_TIME.ply
    #[arg(long)]
    pub ply: bool,

    /// Also the rigid parts that were found, each as a PLY at the first time, and bodies.json with their laws
    #[arg(long)]
    pub bodies: bool,

    /// Members of the ensemble; 0: no uncertainty
    #[arg(long, value_name = "K", default_value_t = 8, value_parser = members)]
    pub members: u32,

    /// Length of an integration step, frames [default: as trained]
    #[arg(long, value_name = "FRAMES", value_parser = positive)]
    pub step: Option<f64>,

    /// The data set [default: that of the run]
    #[arg(long, value_name = "DATASET", value_hint = ValueHint::AnyPath)]
    pub data: Option<PathBuf>,

    /// Device
    #[command(flatten)]
    pub device: DeviceArgs,
}

/// 0, or members that can differ.
fn members(text: &str) -> Result<u32, String> {
    let count = text.parse().ok().filter(|count| *count == 0 || (FEWEST as u32..=MEMBERS_MAX).contains(count));
    count.ok_or_else(|| format!("expected 0, or {FEWEST} to {MEMBERS_MAX} members"))
}

/// A finite number above 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    number(text, |x| x > 0.0, "expected a number above 0")
}
