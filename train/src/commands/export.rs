//! `gsburn export`.

use std::process::ExitCode;

use anyhow::{Result, bail};

use crate::cli::ExportArgs;
use crate::commands::print;
use crate::export::{FloaterFilter, load_scene, truncate_sh, without_floaters, write_ply};
use crate::memory::megabytes;

/// Writes a scene as PLY.
///
/// # Errors
/// One sentence saying what was wrong with the scene or the disk.
pub fn run(args: &ExportArgs) -> Result<ExitCode> {
    if args.out.extension().and_then(|extension| extension.to_str()) != Some("ply") {
        bail!("{}: expected the name of a .ply file", args.out.display());
    }
    // Nothing is computed, so any device serves; the default one is on the CPU when the program has one.
    let device = gs_burn::device::select("auto")?;
    let loaded = load_scene(&args.scene, &device)?;
    let before = loaded.gaussians.len();
    let mut gaussians = loaded.gaussians;
    if args.no_floaters {
        gaussians = without_floaters(&gaussians, &FloaterFilter::default());
    }
    if let Some(degree) = args.sh_degree {
        gaussians = truncate_sh(&gaussians, usize::from(degree));
    }
    write_ply(&args.out, &gaussians, loaded.origin)?;
    let removed = before - gaussians.len();
    let size = std::fs::metadata(&args.out).map_or(0, |metadata| metadata.len());
    let note = if args.no_floaters { format!(", {removed} floaters left out") } else { String::new() };
    print(format!("{}: {} Gaussians{note}, {}", args.out.display(), gaussians.len(), megabytes(size)));
    Ok(ExitCode::SUCCESS)
}
