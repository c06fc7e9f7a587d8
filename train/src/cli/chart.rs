//! Arguments of `gsburn chart`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::ValueHint;

const CHART_EXAMPLES: &str = "\
Examples:
  gsburn chart runs/* --out chart.svg                 every finished run in runs/, and chart.md with the table
  gsburn chart runs/a runs/b --out comparison.html    one page with charts and table that needs no other file
  gsburn chart runs/* --report runs/a                 also as a section of runs/a/report.html
  gsburn chart runs/* --csv runs.csv
  gsburn chart runs/* --beside others.csv             with the points of other programs

Accuracy is PSNR on held-out photos (of moving scenes also of the moving parts alone, on sharp photos where the data set has
them). It is drawn against the processor time of training, all threads, which other work on the machine does not change;
where a run does not know its processor time, against wall-clock time. What nothing beats at its cost is ringed. Runs of
one folder that differ in their seed alone are one curve of their means, with bars from the lowest to the highest. Further
tables give the seconds and the Gaussians at which each run reached 24, 27, 30, ... dB. Runs that are unfinished, have no
figures or are on another data set are named and left out. `gsburn sweep` makes the runs too.";

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

    /// Figures of other programs in the chart of time: a CSV file of program,seconds,psnr (rows of one program are its curve)
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub beside: Option<PathBuf>,

    /// Also put charts and table into the report.html of this run, which keeps them when it is written again (repeatable)
    #[arg(long, value_name = "RUN", value_hint = ValueHint::DirPath)]
    pub report: Vec<PathBuf>,
}
