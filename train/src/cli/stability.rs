//! Arguments of `stability`.

use std::path::PathBuf;

use clap::builder::ValueHint;
use clap::{Args, Subcommand};

use crate::cli::DeviceArgs;

/// Arguments of `stability`.
#[derive(Debug, Args)]
#[command(after_help = STABILITY_EXAMPLES)]
pub struct StabilityArgs {
    /// The method
    #[command(subcommand)]
    pub what: Stability,
}

/// Methods whose limits `stability` looks for.
#[derive(Debug, Subcommand)]
pub enum Stability {
    /// TaylorMoDe-GS: blur and motion, exposure, Taylor paths, depth priors, masks, opacities
    Taylormode(StabilityTaylormodeArgs),
}

const STABILITY_EXAMPLES: &str = "\
Examples:
  gsburn stability taylormode --out runs/stability
  gsburn stability taylormode --out runs/stability --only divergence,direction
  gsburn stability taylormode --out runs/look --quick

Writes a figure (SVG) per experiment, results.json and stability.html, which needs no other file. A bound that is missed is
shown as missed and is no error.";

/// Arguments of `stability taylormode`.
#[derive(Debug, Args)]
#[command(after_help = STABILITY_EXAMPLES)]
pub struct StabilityTaylormodeArgs {
    /// Folder for the small worlds, the figures and the report
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: PathBuf,

    /// Only these experiments: divergence, thrown, samples, direction, exposure, absorb, depth, masks, speed, opacity
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    pub only: Vec<String>,

    /// Fewer variants and steps: a look, not a measurement
    #[arg(long)]
    pub quick: bool,

    /// Device
    #[command(flatten)]
    pub device: DeviceArgs,
}
