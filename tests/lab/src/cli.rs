//! Arguments of `gs-lab`, exactly as typed.

use std::path::PathBuf;

use clap::builder::ValueHint;
use clap::{ArgAction, Args, Parser, Subcommand};

/// The laboratory: experiments at the limits of the methods, comparisons of many runs, and the tables of the docs.
#[derive(Debug, Parser)]
#[command(name = "gs-lab", version, max_term_width = 110)]
pub struct Cli {
    /// The command.
    #[command(subcommand)]
    pub command: Command,

    /// Log more: -v decisions, -vv every change, -vvv everything
    #[arg(short, long, action = ArgAction::Count, global = true)]
    pub verbose: u8,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run experiments at the limits of a method and plot where it fails
    Experiments(ExperimentsArgs),
    /// Chart accuracy against seconds and count of several runs, with the Pareto front
    Chart(ChartArgs),
    /// Write tables of the docs from their data files
    Results(ResultsArgs),
}

/// Arguments of `results`.
#[derive(Debug, Args)]
pub struct ResultsArgs {
    /// The tables: NAME of tests/lab/results/NAME.json
    #[arg(required = true, value_name = "NAME")]
    pub names: Vec<String>,

    /// Folder of runs: where a data file states its runs, those that are missing are trained first
    #[arg(short, long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    pub out: Option<PathBuf>,

    /// The root of the repository
    #[arg(long, value_name = "DIR", default_value = ".", value_hint = ValueHint::DirPath)]
    pub root: PathBuf,

    /// Compute device, as of gsburn
    #[arg(long, default_value = "auto", value_name = "DEVICE")]
    pub device: String,
}

const EXPERIMENTS: &str = "\
Examples:
  gs-lab experiments taylormode --out runs/stability
  gs-lab experiments taylormode --out runs/stability --only divergence,direction
  gs-lab experiments taylormode --out runs/look --quick
  gs-lab experiments taylormode --out runs/sensitivity --only sensitivity --data my-video
  gs-lab experiments sparsedyn --out runs/future
  gs-lab experiments sparsedyn --out runs/future --only integrators,reversal
  gs-lab experiments sparsedyn --out runs/future --only horizon,contacts --quick
  gs-lab experiments flux4d --out runs/limits --only beams,holes

Experiments of sparsedyn:
  integrators  drift on exactly known motions, and the step that keeps it under 1 % (seconds)
  reversal     forwards and backwards again: is the start found? (seconds)
  horizon      four times the time that was seen: PSNR, strays, positions that are no numbers
  views        2 to 15 cameras against the number of Gaussians and the degree of colours
  priors       depth with noise, wrong scales, outliers, doubled, none
  seeds        the spread of eight runs: smaller differences say nothing
  observed     the same future after less of the recording
  step         another integration step and frame rate after training
  contacts     a stop, a bounce, another speed that no photo tells of

Experiments of flux4d, by the network that ships and on streets that it has not seen:
  beams        4 to 128 beams, and images of other sizes
  calibration  wrong camera poses, images that are late
  holes        a black image, a missing sweep, a LiDAR of one beam
  degree       constant velocity or acceleration for traffic
  bins         PSNR by distance, and of the sky
  baseline     a fit of every pair of sweeps on the same points
  cost         seconds by stage and PSNR over 10,000 to half a million points
  weight       the weight of the mean speed over five decades (trainings)

Writes a figure (SVG) per experiment, results.json and stability.html, which needs no other file. A bound that is missed
is shown as missed and is no error. A wrong name after --only lists the experiments. Ctrl-C leaves with exit code 130,
SIGTERM with 143; what was finished before is kept.";

/// Arguments of `experiments`.
#[derive(Debug, Args)]
#[command(after_help = EXPERIMENTS)]
pub struct ExperimentsArgs {
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

    /// Compute device, as of gsburn
    #[arg(long, default_value = "auto", value_name = "DEVICE")]
    pub device: String,
}

const CHART_EXAMPLES: &str = "\
Examples:
  gs-lab chart runs/* --out chart.svg                 every finished run in runs/, and chart.md with the table
  gs-lab chart runs/a runs/b --out comparison.html    one page with charts and table that needs no other file
  gs-lab chart runs/* --report runs/a                 also as a section of runs/a/report.html
  gs-lab chart runs/* --csv runs.csv
  gs-lab chart runs/* --beside others.csv             with the points of other programs

Accuracy is PSNR on held-out photos (of moving scenes also of the moving parts alone, on sharp photos where the data
set has them). It is drawn against the processor time of training, all threads, which other work on the machine does
not change; where a run does not know its processor time, against wall-clock time. What nothing beats at its cost is
ringed. Runs of one folder that differ in their seed alone are one curve of their means, with bars from the lowest to
the highest. Further tables give the seconds and the Gaussians at which each run reached 24, 27, 30, ... dB. Runs that
are unfinished, have no figures or are on another data set are named and left out. `gsburn sweep` makes the runs too.";

/// Arguments of `chart`.
#[derive(Debug, Args)]
#[command(after_help = CHART_EXAMPLES)]
pub struct ChartArgs {
    /// Run folders; files among them are skipped
    #[arg(required = true, value_hint = ValueHint::DirPath)]
    pub runs: Vec<PathBuf>,

    /// An .svg file (a Markdown table of the same runs is written beside it) or an .html page with charts and table
    #[arg(short, long, value_name = "FILE", default_value = "chart.svg", value_hint = ValueHint::FilePath)]
    pub out: PathBuf,

    /// Also write the table to this CSV file
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub csv: Option<PathBuf>,

    /// Figures of other programs in the chart of time: a CSV file of program,seconds,psnr (rows of one program are its
    /// curve)
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub beside: Option<PathBuf>,

    /// Also put charts and table into the report.html of this run, which keeps them when it is written again
    /// (repeatable)
    #[arg(long, value_name = "RUN", value_hint = ValueHint::DirPath)]
    pub report: Vec<PathBuf>,
}
