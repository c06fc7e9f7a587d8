//! `gsburn export`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Result, bail};
use gs_burn::Gaussians;
use gs_datasets::counted;

use crate::cli::ExportArgs;
use crate::commands::print;
use crate::pipelines::load_scene;
use crate::run::memory::megabytes;
use crate::run::outputs;
use crate::run::scene::{FloaterFilter, truncate_sh, without_floaters, write_ply};

/// Writes a scene as PLY.
///
/// # Errors
/// One sentence saying what was wrong with the scene or the disk.
pub fn run(args: &ExportArgs) -> Result<ExitCode> {
    if args.out.extension().and_then(|extension| extension.to_str()) != Some("ply") {
        bail!("{}: expected the name of a .ply file", args.out.display());
    }
    // Nothing is computed, so any device will do.
    let device = gs_burn::device::select("auto")?;
    let loaded = load_scene(&args.scene, &device)?;
    if args.time.is_some() || args.frames.is_some() {
        loaded.moves(&args.scene)?;
    }
    let times = match (args.frames, args.time) {
        (Some(count), _) => loaded.times(count as usize),
        (None, time) => vec![time.unwrap_or(loaded.middle)],
    };
    loaded.warn_outside(args.time);
    let path = |index| if args.frames.is_some() { numbered(&args.out, index) } else { args.out.clone() };
    let paths: Vec<PathBuf> = (0..times.len()).map(path).collect();
    outputs::check(&paths, &[])?;
    for (path, t) in paths.iter().zip(times) {
        write_one(args, path, loaded.scene.at(t), loaded.origin)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn write_one(args: &ExportArgs, path: &Path, mut gaussians: Gaussians, origin: glam::DVec3) -> Result<()> {
    let before = gaussians.len();
    if args.no_floaters {
        gaussians = without_floaters(&gaussians, &FloaterFilter::default());
    }
    if let Some(degree) = args.sh_degree {
        gaussians = truncate_sh(&gaussians, usize::from(degree));
    }
    write_ply(path, &gaussians, origin)?;
    let removed = before - gaussians.len();
    let size = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
    let note = if args.no_floaters { format!(", {} left out", counted(removed, "floater")) } else { String::new() };
    print(format!("{}: {}{note}, {}", path.display(), counted(gaussians.len(), "Gaussian"), megabytes(size)));
    Ok(())
}

/// scene.ply -> scene_0007.ply.
fn numbered(path: &Path, index: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}_{index:04}.ply"))
}
