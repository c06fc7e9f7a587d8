//! `gsburn export`.

mod size;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context, Result, bail};
use burn::tensor::Device;
use glam::{DMat3, DVec3};
use gs_base::counted;
use gs_datasets::{camera_path, load_cameras_by};

use crate::cli::{ExportArgs, Up};
use crate::commands::print;
use gs_pipelines::{load_scene, of_checkpoint};
use gs_train::fit::region::{Region, bounds};
use gs_train::fit::times::through_time;
use gs_train::run::checkpoint::save;
use gs_train::run::exchange::{ENDINGS, Format, Packed};
use gs_train::run::memory::megabytes;
use gs_train::run::outputs;
use gs_train::run::scene::{FloaterFilter, LoadedScene, SceneFile, no_floaters, read_file, within_reach};

use size::fit;

/// Times at which OpenUSD samples a motion, and key frames of a motion without a formula: two seconds of film, and the
/// end.
const SAMPLES: usize = 49;

/// Writes a scene for other programs.
///
/// # Errors
/// One sentence saying what was wrong with the scene or the disk.
pub fn run(args: &ExportArgs) -> Result<ExitCode> {
    let device = gs_burn::device::select("auto")?;
    let format = match Format::of(&args.out) {
        Some(format) => format,
        None if args.out.extension().is_some_and(|ending| ending == "safetensors") => return network(args, &device),
        None => {
            bail!("{}: expected the name of a {ENDINGS} file, or of a network a .safetensors file", args.out.display())
        }
    };
    let loaded = load_scene(&args.scene, &device)?;
    if args.time.is_some() || args.frames.is_some() {
        loaded.moves(&args.scene)?;
    }
    within_reach(&*loaded.scene, "--time", args.time)?;
    loaded.warn_outside(args.time);
    let times = match args.frames {
        Some(count) if !format.moves() => loaded.times(count as usize),
        _ => vec![args.time.unwrap_or(loaded.middle)],
    };
    let moves = format.moves() && args.time.is_none();
    let is_numbered = args.frames.is_some() && !format.moves();
    let path = |index| if is_numbered { numbered(&args.out, index) } else { args.out.clone() };
    let paths: Vec<PathBuf> = (0..times.len()).map(path).collect();
    outputs::check(&paths, &[])?;
    let turn = args.up.map(|up| rotation(args, &loaded, up)).transpose()?;
    let samples = args.frames.map_or(SAMPLES, |count| count as usize);
    let (mut scenes, mut notes) = (Vec::new(), vec![Vec::new(); times.len()]);
    for (gaussians, note) in through_time(&*loaded.scene, &times).zip(&mut notes) {
        let mut scene = loaded.packed(&gaussians, moves, samples);
        if let Some(degree) = args.sh_degree {
            scene = scene.cut(usize::from(degree));
        }
        if args.no_floaters {
            let kept = no_floaters(&gaussians, &FloaterFilter::default());
            note.push(format!("{} left out", counted(scene.splats.len() - kept.len(), "floater")));
            scene = scene.select(&kept);
        }
        scenes.push(scene);
    }
    let region = args.region.map_or(loaded.facts.region, |corners| Region::of(&corners, loaded.origin));
    let mut rows = Vec::new();
    for ((scene, path), note) in scenes.iter().zip(&paths).zip(&mut notes) {
        let inside = region.map(|region| inside(scene, &region, args)).transpose()?;
        if let Some(rows) = &inside {
            let outside = counted(scene.splats.len() - rows.len(), "Gaussian");
            note.push(format!("{outside} outside the box left out"));
        }
        rows.push(if args.keep_far { inside } else { spared(scene, inside, path, format) });
    }
    if let Some(target) = args.target_mb {
        if args.no_floaters {
            bail!("--target-mb and --no-floaters both choose Gaussians; give one of them");
        }
        let report = fit(&mut scenes, &rows, format, target, args, &device)?;
        notes[0].extend(report);
    } else {
        scenes.iter_mut().zip(&rows).for_each(|(scene, rows)| keep(scene, rows.as_deref()));
    }
    for ((path, scene), note) in paths.iter().zip(scenes).zip(notes) {
        let scene = scene.placed();
        let scene = match turn {
            Some(turn) => scene.turned(turn),
            None => scene,
        };
        write_one(path, &scene, format, note)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The rows of a scene in a region.
///
/// # Errors
/// A sentence with the scene's bounds, if there are none.
fn inside(scene: &Packed, region: &Region, args: &ExportArgs) -> Result<Vec<u32>> {
    let (rows, splats) = (scene.within(region), &scene.splats);
    if rows.is_empty() {
        let (key, found) = (if args.region.is_some() { "--box" } else { "data.region" }, args.scene.display());
        let bounds = bounds(&splats.means, DVec3::from_array(splats.offset));
        bail!("{key}: expected Gaussians of {found} in the box, found none; 90 % of them are at {bounds}");
    }
    Ok(rows)
}

/// The Gaussians among `rows`, or among all, that the file is to hold; see [`Packed::spared`].
fn spared(scene: &Packed, rows: Option<Vec<u32>>, path: &Path, format: Format) -> Option<Vec<u32>> {
    let Some(rows) = rows else { return scene.spared(path, format) };
    match scene.select(&rows).spared(path, format) {
        Some(spared) => Some(spared.into_iter().map(|row| rows[row as usize]).collect()),
        None => Some(rows),
    }
}

/// The Gaussians `rows` alone, or all.
fn keep(scene: &mut Packed, rows: Option<&[u32]>) {
    if let Some(rows) = rows {
        *scene = scene.select(rows);
    }
}

/// Writes a file and says what is in it.
///
/// # Errors
/// One sentence that names the file; then no partial file is left.
pub fn write_one(path: &Path, scene: &Packed, format: Format, mut notes: Vec<String>) -> Result<()> {
    scene.write(path, format)?;
    let size = std::fs::metadata(path).map_or(0, |metadata| metadata.len());
    notes.extend(scene.notes(format));
    let notes: String = notes.iter().map(|note| format!(", {note}")).collect();
    print(format!("{}: {}{notes}, {}", path.display(), counted(scene.splats.len(), "Gaussian"), megabytes(size)));
    Ok(())
}

/// The turn after which the scene is upright.
fn rotation(args: &ExportArgs, loaded: &LoadedScene, up: Up) -> Result<DMat3> {
    match up {
        Up::Axis(axis) => upright(axis.into()),
        Up::Auto => {
            let run = loaded.run.as_ref().with_context(|| {
                format!("{}: --up auto asks the cameras of a run; name the axis that is up", args.scene.display())
            })?;
            let cameras = load_cameras_by(&run.dataset, run.poses);
            let cameras = cameras.context("--up auto asks the cameras; name the axis that is up")?;
            let up = camera_path::up(&cameras).with_context(|| {
                format!("{}: its cameras point in all directions; name the axis that is up", run.dataset.display())
            })?;
            upright(up)
        }
    }
}

/// The turn after which `up` is where viewers have it.
///
/// # Errors
/// When `up` has no direction.
pub fn upright(up: DVec3) -> Result<DMat3> {
    gs_splats::turn::upright(up).context("expected an axis that is up, found none")
}

/// Writes the network of a run.
fn network(args: &ExportArgs, device: &Device) -> Result<ExitCode> {
    if args.out.exists() {
        bail!("{}: expected the name of a new file, since it may be a checkpoint of a run", args.out.display());
    }
    let SceneFile::Checkpoint(checkpoint) = read_file(&args.scene)? else {
        bail!("{}: expected a run of a network, found a file of Gaussians", args.scene.display());
    };
    let Some(networks) = of_checkpoint(&checkpoint)?.networks() else {
        bail!("{}: expected a run of a network, found a scene; write it as {ENDINGS}", args.scene.display());
    };
    let network = networks.alone(&checkpoint, device)?;
    // A file that is passed on says nothing of the folders of the machine that made it.
    let mut origin = checkpoint.origin.clone();
    origin.dataset = PathBuf::new();
    save(&args.out, &origin, &network)?;
    let size = std::fs::metadata(&args.out).map_or(0, |metadata| metadata.len());
    print(format!("{}: a network, {}", args.out.display(), megabytes(size)));
    Ok(ExitCode::SUCCESS)
}

/// scene.ply -> scene_0007.ply.
fn numbered(path: &Path, index: usize) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}_{index:04}.{ending}"))
}
