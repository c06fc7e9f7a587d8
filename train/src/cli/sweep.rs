//! Arguments of `gsburn sweep`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::ValueHint;

use super::DeviceArgs;

const SWEEP_EXAMPLES: &str = "\
Examples:
  gsburn sweep cube --recipe taylormode/base \\
      --over blur.samples=3,7,15 --over density.cap=5000,10000 --out runs/cube-sweep
  gsburn sweep cube --recipes taylormode/paper,taylormode/itg,taylormode/base --set steps=2000 --out runs/methods

One run for every combination, one after another, each in a folder of --out that is named after it; then chart.svg, chart.md,
chart.csv and index.html with all of them. The same command again continues: finished runs are kept, an interrupted one goes
on from its newest checkpoint. Ctrl-C saves a checkpoint and leaves with exit code 130.";

/// Arguments of `sweep`.
#[derive(Debug, Args)]
#[command(after_help = SWEEP_EXAMPLES)]
pub struct SweepArgs {
    /// The data set of all runs
    #[arg(value_hint = ValueHint::AnyPath)]
    pub dataset: PathBuf,

    /// Configuration file (TOML) of all runs
    #[arg(short, long, value_name = "FILE", value_hint = ValueHint::FilePath, conflicts_with = "configs")]
    pub config: Option<PathBuf>,

    /// Configuration files to sweep over
    #[arg(long, value_name = "FILE,...", value_delimiter = ',', value_hint = ValueHint::FilePath)]
    pub configs: Vec<PathBuf>,

    /// A recipe that is compiled in, of all runs (`gsburn recipes` lists them)
    #[arg(long, value_name = "NAME", conflicts_with_all = ["config", "configs", "recipes"])]
    pub recipe: Option<String>,

    /// Recipes to sweep over
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', conflicts_with_all = ["config", "configs"])]
    pub recipes: Vec<String>,

    /// Values of one key to sweep over (repeatable: every combination is run)
    #[arg(long, value_name = "KEY=VALUE,...")]
    pub over: Vec<String>,

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
