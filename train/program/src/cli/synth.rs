//! Arguments of `synth`.

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser, ValueHint};
use clap::{Args, Subcommand};
use gs_worlds::deblur::{PriorFault, World};
use gs_worlds::extrapolation::World as Extrapolated;
use gs_worlds::still::World as Still;

/// Arguments of `synth`.
#[derive(Debug, Args)]
pub struct SynthArgs {
    /// The kind of data set
    #[command(subcommand)]
    pub what: Synth,
}

/// The kinds of data sets that `synth` makes.
#[derive(Debug, Subcommand)]
pub enum Synth {
    /// Photos of a still scene, transparent around it, in the layout of the Blender scenes
    Still(SynthStillArgs),
    /// Motion-blurred multi-view video of a small world, ray traced, with sharp images, masks, depth, velocity and
    /// priors
    Deblur(SynthDeblurArgs),
    /// Moving objects or a room filmed by static cameras, whose future is to be predicted, with depth priors of the
    /// first frame
    Extrapolation(SynthExtrapolationArgs),
    /// Driving logs of streets with moving cars, cyclists and people: cameras, LiDAR and exact truth, in PandaSet's
    /// layout
    Driving(SynthDrivingArgs),
    /// A blurry data set from a sharp one: consecutive frames of each camera averaged in linear light
    BlurFromFrames(BlurFromFramesArgs),
}

/// Arguments of `synth still`.
#[derive(Debug, Args)]
pub struct SynthStillArgs {
    /// The scene
    #[arg(value_parser = one_of(&Still::ALL, Still::name, Still::in_words))]
    pub world: Still,

    /// Folder to write
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: PathBuf,

    /// Image size, pixels
    #[arg(long, default_value = "800x800", value_name = "WxH")]
    pub size: String,

    /// Photos to learn from
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=10_000), value_name = "N")]
    pub views: u32,

    /// Photos held out
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(0..=10_000), value_name = "N")]
    pub held_out: u32,

    /// Initial points, sampled on surfaces with noise; 0: none
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub points: usize,

    /// Seed of textures and cameras
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub seed: u64,
}

/// Arguments of `synth deblur`.
#[derive(Debug, Args)]
pub struct SynthDeblurArgs {
    /// cube (slides and turns), lychee (spins), monkey (accelerates), sphere (bounces) or pair (two objects)
    #[arg(value_parser = one_of(&World::ALL, World::name, World::in_words))]
    pub world: World,

    /// Folder to write
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: PathBuf,

    /// Image size, pixels
    #[arg(long, default_value = "256x192", value_name = "WxH")]
    pub size: String,

    /// Cameras, held-out ones included; a held-out camera lies between two others
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u32).range(3..=200), value_name = "N")]
    pub cameras: u32,

    /// Cameras all around, in the open under a sky; otherwise on an arc of 80 degrees in a room
    #[arg(long)]
    pub ring: bool,

    /// Cameras held out
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100), value_name = "N")]
    pub held_out: u32,

    /// Frames of each camera
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=1000), value_name = "N")]
    pub frames: u32,

    /// Instants over which each blurry frame is averaged
    #[arg(long, default_value_t = 32, value_parser = clap::value_parser!(u32).range(16..=4096), value_name = "N")]
    pub subframes: u32,

    /// Exposure time in frame intervals; above 1 exposures overlap
    #[arg(long, default_value_t = 0.9, value_name = "SHARE")]
    pub exposure: f64,

    /// Factor of all speeds
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR")]
    pub speed: f64,

    /// Hand shake: pixels by which the image of each photo to learn from moves while the shutter is open, on a path of
    /// its own
    #[arg(long, default_value_t = 0.0, value_name = "PIXELS")]
    pub shake: f64,

    /// Rolling shutter of a shaking camera: time from the first row's exposure to the last row's, in exposures
    #[arg(long, default_value_t = 0.0, value_name = "EXPOSURES", requires = "shake")]
    pub readout: f64,

    /// Faults of the priors (depth, masks, pseudo-sharp photos); switching one changes the random draws of the others
    #[arg(long, value_parser = one_of(&PriorFault::ALL, PriorFault::name, PriorFault::in_words), value_delimiter = ',',
          value_name = "LIST", default_values_t = PriorFault::USUAL)]
    pub faults: Vec<PriorFault>,

    /// Priors without faults
    #[arg(long, conflicts_with = "faults")]
    pub perfect_priors: bool,

    /// Initial points, sampled on surfaces with noise; 0: none
    #[arg(long, default_value_t = 4000, value_name = "N")]
    pub points: usize,

    /// Seed of textures, static objects and faults
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub seed: u64,
}

/// Arguments of `synth extrapolation`.
#[derive(Debug, Args)]
pub struct SynthExtrapolationArgs {
    /// The world
    #[arg(value_parser = one_of(&Extrapolated::ALL, Extrapolated::name, Extrapolated::in_words))]
    pub world: Extrapolated,

    /// Folder to write
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: PathBuf,

    /// Image size, pixels
    #[arg(long, default_value = "160x160", value_name = "WxH")]
    pub size: String,

    /// Cameras, held-out ones included [default: 15, in the room 25]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=200), value_name = "N")]
    pub cameras: Option<u32>,

    /// Cameras held out [default: 3, in the room 5]
    #[arg(long, value_name = "N")]
    pub held_out: Option<u32>,

    /// Frames of each camera, at times 0 to 1 - 1/N; those up to 0.75 are for training
    #[arg(long, default_value_t = 60, value_parser = clap::value_parser!(u32).range(8..=10_000), value_name = "N")]
    pub frames: u32,

    /// Write true depth and velocity of every N-th frame
    #[arg(long, default_value_t = 15, value_parser = clap::value_parser!(u32).range(1..=10_000), value_name = "N")]
    pub truth_every: u32,

    /// Error of each view's depth scale, a share
    #[arg(long, default_value_t = 0.03, value_name = "SHARE")]
    pub prior_scale: f64,

    /// Error of each view's depth shift, a share of its mean depth
    #[arg(long, default_value_t = 0.01, value_name = "SHARE")]
    pub prior_shift: f64,

    /// Noise of depth, a share of it
    #[arg(long, default_value_t = 0.005, value_name = "SHARE")]
    pub prior_noise: f64,

    /// Share of pixels with a random depth
    #[arg(long, default_value_t = 0.01, value_name = "SHARE")]
    pub prior_outliers: f64,

    /// Priors without errors
    #[arg(long, conflicts_with_all = ["prior_scale", "prior_shift", "prior_noise", "prior_outliers"])]
    pub perfect_priors: bool,

    /// Seed of textures, cameras and errors
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub seed: u64,
}

/// A parser of the names in `all`; help shows each with its description.
fn one_of<T: Copy + Send + Sync + 'static>(
    all: &'static [T],
    name: fn(T) -> &'static str,
    in_words: fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    let values = all.iter().map(|value| PossibleValue::new(name(*value)).help(in_words(*value)));
    let named = move |text: String| all.iter().copied().find(|value| name(*value) == text);
    PossibleValuesParser::new(values).map(move |text| named(text).expect("clap accepts no other"))
}

/// Arguments of `synth driving`.
#[derive(Debug, Args)]
pub struct SynthDrivingArgs {
    /// Folder to write; with --logs above 1 each log has a folder inside, 000 and on
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: PathBuf,

    /// Logs to write; each is another street
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000), value_name = "N")]
    pub logs: u32,

    /// Frames of each log, ten a second
    #[arg(long, default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=300), value_name = "N")]
    pub frames: u32,

    /// Cameras, in the order front, front left, front right, left, right, back
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=6), value_name = "N")]
    pub cameras: u32,

    /// Image size, pixels
    #[arg(long, default_value = "320x180", value_name = "WxH")]
    pub size: String,

    /// Beams of the LiDAR; several numbers are taken in turn, log by log
    #[arg(long, default_value = "32", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..=128), value_name = "N,...")]
    pub beams: Vec<u32>,

    /// Directions in one turn of the LiDAR; several numbers are taken in turn, log by log
    #[arg(long, default_value = "900", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(36..=3600), value_name = "N,...")]
    pub columns: Vec<u32>,

    /// LiDARs; the second one looks the other way and sees each object at another time
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=2), value_name = "N")]
    pub lidars: u32,

    /// Vehicles, cyclists and people that move
    #[arg(long, default_value_t = 16, value_parser = clap::value_parser!(u32).range(0..=60), value_name = "N")]
    pub movers: u32,

    /// Standard deviation of the LiDAR's ranges, metres
    #[arg(long, default_value_t = 0.02, value_name = "M")]
    pub range_noise: f64,

    /// How much later images are taken than their times and poses say, seconds
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true, value_name = "S")]
    pub camera_delay: f64,

    /// Standard deviation of the positions of camera poses, metres, and of their angles in hundredths of a radian
    #[arg(long, default_value_t = 0.0, value_name = "M")]
    pub pose_noise: f64,

    /// Seed of the first log; the next one has the next seed
    #[arg(long, default_value_t = 0, value_name = "N")]
    pub seed: u64,
}

/// Arguments of `synth blur-from-frames`.
#[derive(Debug, Args)]
pub struct BlurFromFramesArgs {
    /// A data set with times and static cameras
    #[arg(value_hint = ValueHint::AnyPath)]
    pub dataset: PathBuf,

    /// Folder to write
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: PathBuf,

    /// Frames averaged into one blurry frame, an odd number
    #[arg(long, default_value_t = 5, value_name = "N")]
    pub window: usize,

    /// Frames from one blurry frame to the next; below the window exposures overlap
    #[arg(long, default_value_t = 5, value_name = "N")]
    pub stride: usize,

    /// The data set's masks are white where something moves: keep them as priors and for measuring
    #[arg(long)]
    pub moving_masks: bool,

    /// Downscale to this width first, pixels
    #[arg(long, value_name = "PIXELS")]
    pub max_width: Option<usize>,
}
