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
    /// The pipeline whose limits are measured
    #[arg(value_name = "PIPELINE")]
    pub pipeline: String,

    /// Folder for the synthetic worlds, the figures and the report
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: PathBuf,

    /// Only these experiments
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub only: Vec<String>,

    /// A data set on which experiments that can use one run too
    #[arg(long, value_name = "DATASET", value_hint = ValueHint::AnyPath)]
    pub data: Option<PathBuf>,

    /// Fewer variants and steps: a first impression, not a measurement
    #[arg(long)]
    pub quick: bool,

    /// Device
    #[command(flatten)]
    pub device: DeviceArgs,
}
