//! Arguments of `gsburn sweep`.

use std::path::PathBuf;

use clap::builder::ValueHint;
use clap::{Args, ValueEnum};

use super::DeviceArgs;
use gs_pipelines::examples;

/// Arguments of `sweep`.
#[derive(Debug, Args)]
#[command(after_help = examples::SWEEP)]
pub struct SweepArgs {
    /// Data sets; of several, each has a folder of its own in --out
    #[arg(required = true, value_name = "DATASET", value_hint = ValueHint::AnyPath)]
    pub datasets: Vec<PathBuf>,

    /// Configuration file (TOML) of all runs
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath, conflicts_with = "configs")]
    pub config: Option<PathBuf>,

    /// Configuration files to sweep over
    #[arg(long, value_name = "FILE,...", value_delimiter = ',', value_hint = ValueHint::FilePath)]
    pub configs: Vec<PathBuf>,

    /// A compiled-in recipe of all runs, or one for each data set in their order (`gsburn recipes` lists them)
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', conflicts_with_all = ["config", "configs", "recipes"])]
    pub recipe: Vec<String>,

    /// Recipes to sweep over
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', conflicts_with_all = ["config", "configs"])]
    pub recipes: Vec<String>,

    /// Values of one key to sweep over (repeatable: every combination is run)
    #[arg(long, value_name = "KEY=VALUE,...")]
    pub over: Vec<String>,

    /// Change one value at a time: a run without any change, and one for each value of --over
    #[arg(long)]
    pub one_at_a_time: bool,

    /// Choose a model afterwards, by a held-out split that is not the reported one; without --over, the pipeline's own
    /// small grid
    #[arg(long, value_name = "RULE", value_enum)]
    pub choose: Option<Rule>,

    /// The split by which --choose chooses
    #[arg(long, value_name = "NAME", default_value = "validation", requires = "choose")]
    pub choose_by: String,

    /// Set one value in all runs, as in --set steps=2000 (repeatable)
    #[arg(short, long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,

    /// Folder for the runs and the comparison
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: PathBuf,

    /// Show no progress
    #[arg(short, long)]
    pub quiet: bool,

    /// Device
    #[command(flatten)]
    pub device: DeviceArgs,
}

/// How a model is chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Rule {
    /// The smallest scene whose PSNR is within one standard error of the best
    Smallest,
}
