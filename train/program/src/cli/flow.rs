//! Arguments of `flow`.

use std::path::PathBuf;

use clap::builder::ValueHint;
use clap::{Args, ValueEnum};

use crate::cli::DeviceArgs;
use gs_pipelines::examples;

/// The points that are scored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ScoredPoints {
    /// All with a label
    All,
    /// Argoverse 2's: not on the ground by the map; three-way errors within 50 m, bucketed ones within 35 m
    Av2,
}

/// Arguments of `flow`.
#[derive(Debug, Args)]
#[command(after_help = examples::FLOW)]
pub struct FlowArgs {
    /// The driving log: a folder of PandaSet, Argoverse 2 or (with the feature `waymo`) Waymo; images are not needed
    #[arg(value_hint = ValueHint::DirPath)]
    pub log: PathBuf,

    /// Folder for the flow of every sweep (NumPy arrays) and the figures [default: the figures are printed alone]
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: Option<PathBuf>,

    /// Sweeps that are looked at together
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u8).range(2..=100), value_name = "N")]
    pub window: u8,

    /// Points that are scored
    #[arg(long, value_enum, default_value_t = ScoredPoints::All, value_name = "PROTOCOL")]
    pub protocol: ScoredPoints,

    /// Fit a network to every pair of sweeps instead, with at most this many iterations: a baseline
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=1_000_000), value_name = "N")]
    pub fit: Option<u32>,

    /// Device of the fit
    #[command(flatten)]
    pub device: DeviceArgs,
}
