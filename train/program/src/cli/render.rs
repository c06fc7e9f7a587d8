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

const RENDER_EXAMPLES: &str = "\
Examples:
  gsburn render runs/my-photos --out frames                              the cameras of the data set
  gsburn render runs/my-photos --orbit --video --out film
  gsburn render runs/my-video --between DSC_01 DSC_09 --images 240 --size 1920x1080 --video --out film
  gsburn render scene.ply --cameras path.json --out frames               key frames, see docs/formats.md
  gsburn render runs/my-video --cameras my-video --time 0.5 --out frames";

/// Arguments of `render`.
#[derive(Debug, Args)]
#[command(after_help = RENDER_EXAMPLES)]
pub struct RenderArgs {
    /// A run folder, a checkpoint (.safetensors) or a scene (.ply, .spz, .glb, .sog, .splat, .ksplat)
    #[arg(value_hint = ValueHint::AnyPath)]
    pub scene: PathBuf,

    /// Cameras: a transforms.json, a folder with one or with a COLMAP model (photos need not exist), a JSON file of key
    /// frames, Inria's cameras.json or nerfstudio's camera_path.json; images are named after its frames [default: the
    /// run's data set]
    #[arg(long, value_name = "PATH", value_hint = ValueHint::AnyPath)]
    pub cameras: Option<PathBuf>,

    /// In place of the cameras: a circle round what they look at, at their median distance and height
    #[arg(long, conflicts_with_all = ["spiral", "between", "frames"])]
    pub orbit: bool,

    /// In place of the cameras: a spiral about their middle
    #[arg(long, conflicts_with_all = ["between", "frames"])]
    pub spiral: bool,

    /// In place of the cameras: the straight way from one to another, by their names
    #[arg(long, num_args = 2, value_names = ["A", "B"], conflicts_with = "frames")]
    pub between: Vec<String>,

    /// Images of the path; a moving scene goes through its recording meanwhile [default: 120]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub images: Option<u32>,

    /// Size of the images, with the same angle of view over the height [default: the cameras' own]
    #[arg(long, value_name = "WxH")]
    pub size: Option<String>,

    /// Also one film of all images in their order, video.mp4 (by ffmpeg; a GIF where that is not installed)
    #[arg(long)]
    pub video: bool,

    /// Images a second of the film
    #[arg(long, value_name = "N", default_value_t = 24, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub fps: u32,

    /// Folder for the images
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: PathBuf,

    /// File format
    #[arg(long, value_enum, default_value_t = ImageFormat::Png)]
    pub format: ImageFormat,

    /// Time of a moving scene, in its data set's unit [default: each camera's own, or the middle of the recording]
    #[arg(long, value_name = "T", allow_negative_numbers = true, value_parser = finite, conflicts_with = "frames")]
    pub time: Option<f64>,

    /// Every camera (named after its first frame) at N times spread over the recording; images are numbered, ready for
    /// a video encoder
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub frames: Option<u32>,

    /// With --frames: also an animated GIF per camera
    #[arg(long, requires = "frames")]
    pub gif: bool,

    /// Also depth in colour (near bright, far dark) and, of a moving scene, velocity in colour (grey: at rest; red,
    /// green and blue: the world's axes)
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

impl RenderArgs {
    /// Whether images are along a path and not at the cameras themselves.
    pub fn is_path(&self) -> bool {
        self.orbit || self.spiral || !self.between.is_empty()
    }
}

/// A finite number.
pub(super) fn finite(text: &str) -> Result<f64, String> {
    number(text, |_| true, "expected a finite number")
}

/// A finite number that `holds`, or the sentence `expected`.
pub(super) fn number(text: &str, holds: impl Fn(f64) -> bool, expected: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x: &f64| x.is_finite() && holds(*x)).ok_or_else(|| expected.into())
}
