//! A file of at most some size: the Gaussians that contribute most to the training photos, and what the others are
//! missed for.

use anyhow::{Context, Result, bail};
use burn::tensor::Device;
use gs_burn::{Gaussians, RenderOptions, render};
use gs_datasets::{Scene, View};
use gs_models::DynamicScene;

use crate::cli::ExportArgs;
use gs_pipelines::{Opened, of_checkpoint};
use gs_train::fit::density::prune::contributions;
use gs_train::fit::photos::{camera, mask_of, to_tensor};
use gs_train::fit::times::through_time;
use gs_train::run::exchange::{Format, Packed};
use gs_train::run::metrics::psnr_counted;
use gs_train::run::scene::{LoadedScene, SceneFile, read_file};

use super::keep;

/// Sizes that are tried: each brings the count nearer to the largest that fits, and the fourth is within a few percent
/// of it.
const TRIALS: usize = 8;

/// A file that is at least this share of what is allowed is full.
const FULL: f64 = 0.98;

/// Selects Gaussians of each scene, of its `rows` if only these may stay, so that its file takes at most `target`
/// megabytes; returns what that costs, in words.
///
/// # Errors
/// A sentence when the scene is none of a run whose photos are there, or nothing fits.
pub(super) fn fit(
    scenes: &mut [Packed],
    rows: &[Option<Vec<u32>>],
    format: Format,
    target: f64,
    args: &ExportArgs,
    device: &Device,
) -> Result<Vec<String>> {
    let bytes = target * 1e6;
    let mut whole = scenes.to_vec();
    whole.iter_mut().zip(rows).for_each(|(scene, rows)| keep(scene, rows.as_deref()));
    if whole.iter().map(|scene| scene.length(format)).collect::<Result<Vec<_>>>()?.iter().all(|n| *n as f64 <= bytes) {
        scenes.clone_from_slice(&whole);
        return Ok(vec![format!("all fit into {target} MB")]);
    }
    let SceneFile::Checkpoint(checkpoint) = read_file(&args.scene)? else {
        bail!("{}: --target-mb needs a run, whose photos say which Gaussians contribute", args.scene.display());
    };
    let dataset = checkpoint.origin.dataset.clone();
    let Opened { loaded, photos } = of_checkpoint(&checkpoint)?
        .open(&checkpoint, Some(&dataset), device)
        .context("--target-mb looks at the photos of the run")?;
    let photos = photos.context("a data set was named")?;
    let options = RenderOptions { background: [0.0; 3], ..loaded.render_options(0) };
    let sums = contributions(&*loaded.scene, &photos.train, &options, 0);
    let mut order: Vec<u32> = (0..sums.len() as u32).collect();
    // Of equal contributions the lower row stays.
    order.sort_by(|a, b| sums[*b as usize].total_cmp(&sums[*a as usize]));
    let (shown, views) = shown(&photos);
    let usual = loaded.render_options(3);
    let before = mean_psnr(&*loaded.scene, views, &usual);
    let of = |rows: &Option<Vec<u32>>| -> Vec<u32> {
        let may_stay = |row: &u32| rows.as_ref().is_none_or(|rows| rows.binary_search(row).is_ok());
        order.iter().copied().filter(may_stay).collect()
    };
    for (scene, rows) in scenes.iter_mut().zip(rows) {
        *scene = most(scene, format, bytes, &of(rows))?;
    }
    let total: f64 = sums.iter().sum();
    let kept = &of(&rows[0])[..scenes[0].splats.len()];
    let share: f64 = kept.iter().map(|row| sums[*row as usize]).sum::<f64>() / total.max(f64::MIN_POSITIVE);
    let read = LoadedScene::of_packed(scenes[0].as_read(format)?, device);
    let mut notes = vec![format!("of {} those with {:.1} % of the contribution", sums.len(), 100.0 * share)];
    // A single moment of a moving scene cannot be held against photos of other times.
    if loaded.scene.span().is_none() || scenes[0].motion.is_some() {
        let after = mean_psnr(&*read.scene, views, &usual);
        notes.push(format!("PSNR {after:.2} dB on the {shown} photos, {before:.2} dB before"));
    }
    Ok(notes)
}

/// As many of the first of `order` as fit, rows in their own order.
fn most(scene: &Packed, format: Format, bytes: f64, order: &[u32]) -> Result<Packed> {
    let of_count = |count: usize| {
        let mut rows = order[..count].to_vec();
        rows.sort_unstable();
        scene.select(&rows)
    };
    let (mut fits, mut too_many) = (None, order.len());
    let mut count = order.len();
    let mut length = of_count(count).length(format)? as f64;
    for _ in 0..TRIALS {
        let floor = fits.as_ref().map_or(0, |scene: &Packed| scene.splats.len());
        if floor + 1 >= too_many {
            break;
        }
        // Bytes go almost in proportion to the count.
        count = ((count as f64 * bytes * (1.0 + FULL) / 2.0 / length) as usize).clamp(floor + 1, too_many - 1);
        let trial = of_count(count);
        length = trial.length(format)? as f64;
        if length > bytes {
            too_many = count;
        } else {
            fits = Some(trial);
            if length >= FULL * bytes {
                break;
            }
        }
    }
    fits.with_context(|| format!("--target-mb: not one Gaussian fits into {} MB", bytes / 1e6))
}

/// The photos that are reported on: held-out ones, or those of the training where none are.
fn shown(photos: &Scene) -> (&'static str, &[View]) {
    match photos.reported().filter(|split| !split.views.is_empty()) {
        Some(split) => ("held-out", &split.views),
        None => ("training", &photos.train),
    }
}

fn mean_psnr(scene: &dyn DynamicScene, views: &[View], options: &RenderOptions) -> f64 {
    let times: Vec<f64> = views.iter().map(|view| view.time.unwrap_or(0.0)).collect();
    let score = |(view, gaussians): (&View, Gaussians)| {
        let device = gaussians.device();
        let image = render(&gaussians, &camera(view, &device), options).color;
        let photo = view.truth.sharp.as_ref().unwrap_or(&view.image);
        let truth = to_tensor(view, &photo.data, 3, &device);
        psnr_counted(image, truth, mask_of(view, &device))
    };
    views.iter().zip(through_time(scene, &times)).map(score).sum::<f64>() / views.len().max(1) as f64
}
