//! Arguments of `export` and `convert`, the commands that write scenes for other programs.

use std::path::PathBuf;

use clap::Args;
use clap::builder::ValueHint;

use super::render::{finite, number};
use gs_train::config::is_box;

const EXPORT_EXAMPLES: &str = "\
Examples:
  gsburn export runs/my-photos --out scene.ply            the layout of 3DGS, which everybody reads
  gsburn export runs/my-photos --out scene.spz --up auto  a sixth of the size, and upright in viewers
  gsburn export runs/my-video --out scene.glb             glTF with the motion; other viewers show the middle
  gsburn export runs/my-video --out scene.usda --frames 49
  gsburn export runs/my-photos --out small.spz --target-mb 2
  gsburn export runs/my-photos --out thing.ply --box -1,-1,0,1,1,2

docs/formats.md has the layouts, and what each of them loses.";

/// Arguments of `export`.
#[derive(Debug, Args)]
#[command(after_help = EXPORT_EXAMPLES)]
pub struct ExportArgs {
    /// A run folder, a checkpoint (.safetensors) or a scene (.ply, .spz, .glb, .sog, .splat, .ksplat)
    #[arg(value_hint = ValueHint::AnyPath)]
    pub scene: PathBuf,

    /// The file to write, in the data set's own world: .ply (3DGS layout), .spz, .glb or .usda by its ending; of a
    /// network, the .safetensors file to write without the state of its optimiser
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub out: PathBuf,

    /// Time of a moving scene, in its data set's unit [default: the middle of the recording; .glb and .usda hold all
    /// times]
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite, conflicts_with = "frames")]
    pub time: Option<f64>,

    /// N times spread over the recording: of .ply and .spz one numbered file each, of .usda samples in the one file
    /// [default there: 49], of .glb key frames where the motion has no formula
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub frames: Option<u32>,

    /// Leave out nearly transparent, oversized and isolated Gaussians
    #[arg(long)]
    pub no_floaters: bool,

    /// Write only Gaussians in a box of the data set's world; of a motion, those that are in it at some time [default:
    /// data.region of the run]
    #[arg(long = "box", value_name = "X0,Y0,Z0,X1,Y1,Z1", allow_hyphen_values = true, value_parser = corners)]
    pub region: Option<[f64; 6]>,

    /// Keep SH only up to this degree
    #[arg(long, value_name = "0..3", value_parser = clap::value_parser!(u8).range(0..=3))]
    pub sh_degree: Option<u8>,

    /// The axis of the data set's world that points up, or auto: up by the cameras. The scene is turned so that viewers
    /// show it upright
    #[arg(long, value_name = "x|y|z|-x|-y|-z|auto", allow_hyphen_values = true, value_parser = up)]
    pub up: Option<Up>,

    /// Merge Gaussians, and leave out those that the training photos miss least, until the file has at most this size;
    /// say what that costs on held-out photos. Moving ones are only left out
    #[arg(long, value_name = "MB", value_parser = megabytes)]
    pub target_mb: Option<f64>,

    /// Keep Gaussians far from all others in an SPZ file, where they make the positions of all coarser [default: left
    /// out, and said]
    #[arg(long)]
    pub keep_far: bool,
}

/// Arguments of `convert`.
#[derive(Debug, Args)]
pub struct ConvertArgs {
    /// The file to read: .ply (also compressed by PlayCanvas), .spz (2 to 4), .glb, .sog or a SOG folder, .splat or
    /// .ksplat
    #[arg(value_name = "FROM", value_hint = ValueHint::FilePath)]
    pub from: PathBuf,

    /// The file to write: .ply, .spz, .glb or .usda
    #[arg(value_name = "TO", value_hint = ValueHint::FilePath)]
    pub to: PathBuf,

    /// The axis of the file's world that points up [default: -y, as viewers take a PLY]
    #[arg(long, value_name = "x|y|z|-x|-y|-z", allow_hyphen_values = true, value_parser = axis)]
    pub up: Option<Up>,

    /// Keep SH only up to this degree
    #[arg(long, value_name = "0..3", value_parser = clap::value_parser!(u8).range(0..=3))]
    pub sh_degree: Option<u8>,

    /// Keep Gaussians far from all others in an SPZ file, where they make the positions of all coarser [default: left
    /// out, and said]
    #[arg(long)]
    pub keep_far: bool,
}

/// The direction that is up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Up {
    /// A direction of the world.
    Axis([f64; 3]),
    /// The mean up of the cameras.
    Auto,
}

fn up(text: &str) -> Result<Up, String> {
    if text == "auto" { Ok(Up::Auto) } else { axis(text).map_err(|_| "expected x, y, z, -x, -y, -z or auto".into()) }
}

fn axis(text: &str) -> Result<Up, String> {
    let (sign, name) = text.strip_prefix('-').map_or((1.0, text), |name| (-1.0, name));
    let axis = match name {
        "x" => [sign, 0.0, 0.0],
        "y" => [0.0, sign, 0.0],
        "z" => [0.0, 0.0, sign],
        _ => return Err("expected x, y, z, -x, -y or -z".into()),
    };
    Ok(Up::Axis(axis))
}

fn corners(text: &str) -> Result<[f64; 6], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let corners = numbers.filter(|numbers| is_box(numbers)).and_then(|numbers| numbers.try_into().ok());
    corners.ok_or_else(|| "expected six numbers x0,y0,z0,x1,y1,z1 with x0 < x1, y0 < y1, z0 < z1".into())
}

fn megabytes(text: &str) -> Result<f64, String> {
    number(text, |x| x > 0.0, "expected a size above 0, in megabytes")
}
