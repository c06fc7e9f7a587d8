//! `gsburn convert`.

use std::process::ExitCode;

use anyhow::{Context, Result, bail};

use crate::cli::{ConvertArgs, Up};
use crate::commands::export::{upright, write_one};
use gs_train::run::exchange::{ENDINGS, Format, Packed, READ, read_packed};
use gs_train::run::outputs;

/// Times at which OpenUSD samples a motion: two seconds of film, and the end.
const SAMPLES: usize = 49;

/// Turns a file of Gaussians into another.
///
/// # Errors
/// One sentence saying what was wrong with the files.
pub fn run(args: &ConvertArgs) -> Result<ExitCode> {
    let Some(format) = Format::of(&args.to) else {
        bail!("{}: expected the name of a {ENDINGS} file", args.to.display());
    };
    if !args.from.exists() {
        bail!("{}: expected a file of Gaussians, found nothing", args.from.display());
    }
    let packed =
        read_packed(&args.from)?.with_context(|| format!("{}: expected a scene ({READ})", args.from.display()))?;
    if args.to.exists() && args.from.canonicalize().ok() == args.to.canonicalize().ok() {
        bail!("{}: this is the file to read; name another to write", args.to.display());
    }
    outputs::check_one(&args.to)?;
    let mut packed = Packed { samples: SAMPLES, ..packed };
    if let Some(degree) = args.sh_degree {
        packed = packed.cut(usize::from(degree));
    }
    if let Some(Up::Axis(axis)) = args.up {
        packed = packed.turned(upright(axis.into())?);
    }
    if packed.motion.is_some() && !format.moves() {
        tracing::warn!("{}: holds one moment of the scene, the middle of its recording", args.to.display());
        packed.motion = None;
    }
    if !args.keep_far
        && let Some(rows) = packed.spared(&args.to, format)
    {
        packed = packed.select(&rows);
    }
    write_one(&args.to, &packed, format, Vec::new())?;
    Ok(ExitCode::SUCCESS)
}
