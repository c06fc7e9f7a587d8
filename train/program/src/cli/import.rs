//! Arguments of `import`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::ValueHint;
use gs_datasets::import::Fit;

use gs_pipelines::examples;

/// Arguments of `import`.
#[derive(Debug, Args)]
#[command(after_help = examples::IMPORT)]
pub struct ImportArgs {
    /// The reconstruction: a .npz archive, or a folder of .npy files with the same names
    #[arg(value_hint = ValueHint::AnyPath)]
    pub reconstruction: PathBuf,

    /// The data set with known cameras that the priors are for
    #[arg(long, value_name = "DATASET", value_hint = ValueHint::AnyPath)]
    pub into: PathBuf,

    /// A new folder for the priors and a copy of the JSON that names them; photos stay where they are [default: beside the photos,
    /// where the data set has times, no depth priors and no truth]
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: Option<PathBuf>,

    /// Views in the order of the prediction, by name, by file, or by camera at the first time [default: image_names of the archive,
    /// else the training views of the first time]
    #[arg(long, value_name = "LIST", value_delimiter = ',', conflicts_with = "images")]
    pub views: Vec<String>,

    /// The same from a text file with a name or path in each line
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub images: Option<PathBuf>,

    /// How photos were fitted into the processed size: auto, crop (VGGT's default), pad or stretch
    #[arg(long, default_value = "auto", value_name = "HOW")]
    pub fit: Fit,

    /// Share of pixels, those of the highest confidence, that become points
    #[arg(long, default_value_t = 0.8, value_name = "SHARE")]
    pub keep: f64,

    /// Points at most
    #[arg(long, default_value_t = 200_000, value_name = "N")]
    pub max_points: usize,

    /// Also fit depth to the points of a data set that is no COLMAP model (they may be another prediction)
    #[arg(long)]
    pub use_points: bool,
}
