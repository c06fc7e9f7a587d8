//! `gsburn export`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Result, bail};
use burn::tensor::Device;
use gs_burn::Gaussians;
use gs_datasets::counted;

use crate::cli::ExportArgs;
use crate::commands::print;
use crate::pipelines::{load_scene, of_checkpoint};
use crate::run::checkpoint::save;
use crate::run::memory::megabytes;
use crate::run::outputs;
use crate::run::scene::{FloaterFilter, SceneFile, read_file, truncate_sh, without_floaters, write_ply};

/// Writes a scene as PLY.
///
/// # Errors
/// One sentence saying what was wrong with the scene or the disk.
pub fn run(args: &ExportArgs) -> Result<ExitCode> {
    // Nothing is computed, so any device will do.
    let device = gs_burn::device::select("auto")?;
    match args.out.extension().and_then(|extension| extension.to_str()) {
        Some("ply") => {}
        Some("safetensors") => return network(args, &device),
        _ => bail!("{}: expected the name of a .ply file, or of a network a .safetensors file", args.out.display()),
    }
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

/// Writes the network of a run.
fn network(args: &ExportArgs, device: &Device) -> Result<ExitCode> {
    if args.out.exists() {
        bail!("{}: expected the name of a new file, since it may be a checkpoint of a run", args.out.display());
    }
    let SceneFile::Checkpoint(checkpoint) = read_file(&args.scene, device)? else {
        bail!("{}: expected a run of a network, found a PLY file", args.scene.display());
    };
    let Some(network) = of_checkpoint(&checkpoint)?.network(&checkpoint, device)? else {
        bail!("{}: expected a run of a network, found a scene; write it as .ply", args.scene.display());
    };
    // A file that is passed on says nothing of the folders of the machine that made it.
    let mut origin = checkpoint.origin.clone();
    origin.dataset = PathBuf::new();
    save(&args.out, &origin, &network)?;
    let size = std::fs::metadata(&args.out).map_or(0, |metadata| metadata.len());
    print(format!("{}: a network, {}", args.out.display(), megabytes(size)));
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
