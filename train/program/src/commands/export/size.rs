//! A file of at most some size: Gaussians are merged, those that the training photos miss least are left out, and what
//! that costs is said.

use anyhow::{Context, Result, bail};
use burn::tensor::Device;
use gs_base::counted;
use gs_burn::{Gaussians, RenderOptions, render};
use gs_datasets::{Scene, View};
use gs_models::DynamicScene;
use gs_splats::Merged;

use crate::cli::ExportArgs;
use gs_pipelines::{Opened, of_checkpoint};
use gs_train::fit::density::prune::contributions;
use gs_train::fit::photos::{camera, colors_of, mask_of, to_tensor};
use gs_train::fit::times::through_time;
use gs_train::run::exchange::{Format, Packed};
use gs_train::run::metrics::psnr_counted;
use gs_train::run::scene::{LoadedScene, SceneFile, read_file};

use super::keep;

/// Merges Gaussians of each scene, of its `rows` if only these may stay, so that its file takes at most `target`
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
    let (shown, views) = shown(&photos);
    let usual = loaded.render_options(3);
    let before = mean_psnr(&*loaded.scene, views, &usual);
    for ((scene, whole), rows) in scenes.iter_mut().zip(&whole).zip(rows) {
        let of = |rows: &Vec<u32>| rows.iter().map(|row| sums[*row as usize]).collect();
        *scene = merged(whole, &rows.as_ref().map_or_else(|| sums.clone(), of), format, bytes)?;
    }
    let read = LoadedScene::of_packed(scenes[0].as_read(format)?, device);
    let mut notes = vec![format!("in place of {}", counted(sums.len(), "Gaussian"))];
    if scenes.iter().any(|scene| scene.motion.is_some()) {
        notes.push("of which moving ones were left out and not merged".into());
    }
    // Photos show more than a box, and other times than a single moment of a moving scene.
    let is_whole = args.region.is_none() && loaded.facts.region.is_none();
    if is_whole && (loaded.scene.span().is_none() || scenes[0].motion.is_some()) {
        let after = mean_psnr(&*read.scene, views, &usual);
        notes.push(format!("PSNR {after:.2} dB on the {shown} photos, {before:.2} dB before"));
    }
    Ok(notes)
}

/// As many Gaussians in place of `whole`, with these contributions, as fit into `bytes`. Moving ones are not merged.
fn merged(whole: &Packed, contributions: &[f64], format: Format, bytes: f64) -> Result<Packed> {
    let moving = whole.motion.as_ref().map_or(&[][..], |motion| &motion.rows);
    let mut merged = Merged::of(&whole.splats, contributions, moving);
    loop {
        let motion = whole.motion.as_ref().map(|motion| motion.select(&merged.rows));
        let scene = Packed { splats: merged.splats.clone(), motion, samples: whole.samples };
        let (count, length) = (scene.splats.len(), scene.length(format)? as f64);
        if length <= bytes {
            return Ok(scene);
        }
        // Bytes go almost in proportion to the count.
        let fewer = ((count as f64 * bytes / length) as usize).min(count.saturating_sub(1));
        if fewer == 0 {
            bail!("--target-mb: not one Gaussian fits into {} MB", bytes / 1e6);
        }
        merged.reduce(fewer);
    }
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
        let (view, device) = (view.decoded(), gaussians.device());
        let image = render(&gaussians, &camera(&view, &device), options).color;
        let sharp = view.truth.sharp.as_ref().map(|sharp| to_tensor(&view, &sharp.data, 3, &device));
        let truth = sharp.unwrap_or_else(|| colors_of(&view, &device));
        psnr_counted(image, truth, mask_of(&view, &device))
    };
    views.iter().zip(through_time(scene, &times)).map(score).sum::<f64>() / views.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_splats::{Keys, Law, Motion, Splats};

    /// Every second Gaussian of a file moves: each that stays is as it was, with its own path.
    #[test]
    fn moving_ones_are_left_out_and_not_merged() {
        let wave = |i: usize, k: usize| ((13 * i + 7 * k) as f32 * 0.731).sin();
        let splats = Splats {
            means: (0..80).map(|i| [wave(i, 0), wave(i, 1), wave(i, 2)]).collect(),
            quats: vec![[1.0, 0.0, 0.0, 0.0]; 80],
            log_scales: vec![[-2.0; 3]; 80],
            opacity_logits: vec![0.5; 80],
            sh: vec![[0.5; 3]; 80],
            ..Splats::default()
        };
        let rows: Vec<u32> = (0..80).step_by(2).collect();
        let means = rows.iter().map(|row| splats.means[*row as usize]).collect();
        let keys = Keys { times: vec![0.0], means, quats: vec![[1.0, 0.0, 0.0, 0.0]; 40], log_scales: Vec::new() };
        let motion = Some(Motion { span: [0.0, 1.0], middle: 0.0, rows, law: Law::Keys(keys) });
        let whole = Packed { splats, motion, samples: 0 };
        let bytes = 0.6 * whole.length(Format::Glb).expect("a file") as f64;
        let scene = merged(&whole, &[1.0; 80], Format::Glb, bytes).expect("it fits");
        assert!(scene.length(Format::Glb).expect("a file") as f64 <= bytes);
        let motion = scene.motion.expect("it moves");
        let Law::Keys(keys) = motion.law else { panic!("key frames") };
        assert!(!motion.rows.is_empty() && motion.rows.len() < scene.splats.len());
        for (row, mean) in motion.rows.iter().zip(keys.means) {
            assert_eq!(scene.splats.means[*row as usize], mean);
            assert!(whole.splats.means.contains(&mean));
        }
        assert!(merged(&whole, &[1.0; 80], Format::Glb, 10.0).is_err());
    }
}
