//! Arguments of `render`.

use std::path::PathBuf;

use clap::builder::ValueHint;
use clap::{Args, ValueEnum};

use crate::cli::DeviceArgs;

/// Image files that `render` writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ImageFormat {
    /// NAME.png (8-bit colour), NAME_depth.png (16-bit, 1/1000 scene unit, 0 = no depth) and NAME_alpha.png (8-bit)
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

    /// Time of a moving scene, in its data set's unit [default: each camera's own, or the middle of the recording]
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite, conflicts_with = "frames")]
    pub time: Option<f64>,

    /// Every camera (named after its first frame) at N times spread over the recording; images are numbered, ready for a video
    /// encoder
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub frames: Option<u32>,

    /// With --frames: also an animated GIF per camera
    #[arg(long, requires = "frames")]
    pub gif: bool,

    /// Also depth in colour (near bright, far dark) and, of a moving scene, velocity in colour (grey: at rest; red, green and blue:
    /// the world's axes)
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

/// A finite number.
pub(super) fn finite(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err("expected a finite number".into()),
    }
}
