//! Arguments of `stability`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::ValueHint;

use crate::cli::DeviceArgs;
use crate::pipelines::examples;

/// Arguments of `stability`.
#[derive(Debug, Args)]
#[command(after_help = examples::STABILITY)]
pub struct StabilityArgs {
    /// The pipeline whose limits are looked for
    #[arg(value_name = "PIPELINE")]
    pub pipeline: String,

    /// Folder for the small worlds, the figures and the report
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: PathBuf,

    /// Only these experiments
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub only: Vec<String>,

    /// A data set that experiments run on beside their own worlds, where they can
    #[arg(long, value_name = "DATASET", value_hint = ValueHint::AnyPath)]
    pub data: Option<PathBuf>,

    /// Fewer variants and steps: a look, not a measurement
    #[arg(long)]
    pub quick: bool,

    /// Device
    #[command(flatten)]
    pub device: DeviceArgs,
}
