//! `gsburn eval`.

use std::process::ExitCode;

use anyhow::{Result, bail};
use gs_datasets::image_io::{write_atomic, write_png};

use crate::cli::EvalArgs;
use crate::commands::train::resolve;
use crate::commands::{device, print};
use crate::data::{Photos, settled};
use crate::evaluate::{Evaluation, Evaluator};
use crate::export::{LoadedScene, load_scene};
use crate::report::pictures::SideBySide;
use crate::resources::peak_memory;
use crate::taylormode::measure;

/// Measures a scene on the held-out views of its data set.
///
/// # Errors
/// One sentence saying what was wrong with the scene or the data set.
pub fn run(args: &EvalArgs) -> Result<ExitCode> {
    let device = device(&args.device)?;
    let loaded = load_scene(&args.scene, &device)?;
    let typed = args.config.config.is_some() || !args.config.set.is_empty();
    let config = match &loaded.config {
        Some(_) if typed => {
            bail!("{}: a run has its own configuration; leave out --config and --set", args.scene.display())
        }
        Some(config) => config.clone(),
        None => resolve(&args.config, &[])?,
    };
    let Some(dataset) = args.data.clone().or(loaded.dataset.clone()) else {
        bail!("{}: a PLY file does not know its data set; name it with --data", args.scene.display());
    };
    let scene = config.load(&dataset)?;
    // As training would: a checkpoint's is settled already, what a PLY file was trained with is found again.
    let config = settled(&config, &scene);
    // A PLY file is in the data set's own world, a checkpoint where training was; views are where training would be.
    let moved = crate::export::translated(&loaded.gaussians, loaded.origin - scene.origin);
    let loaded = LoadedScene { gaussians: moved, ..loaded };
    let (views, split) = if scene.test.is_empty() { (&scene.train, "train") } else { (&scene.test, "test") };
    let kept = if args.renders.is_some() { views.len() } else { 0 };
    let mut photos = Photos::new(views, &device, 0);
    let (measured, comparisons) =
        Evaluator::new(&config.eval, &device).evaluate(&*loaded.model(), &mut photos, &config, kept);
    let evaluation = Evaluation {
        step: loaded.step.unwrap_or(0),
        split: split.into(),
        peak_memory_bytes: peak_memory(),
        motion: loaded.motion.as_ref().map(|state| measure::measure(state, &loaded.gaussians, &scene, &config)),
        ..measured
    };

    // Before files are written: a disk that is full does not cost the figures.
    print(table(&evaluation));
    if let Some(folder) = &args.renders {
        for picture in comparisons.iter().map(SideBySide::new) {
            let path = folder.join(format!("{}.png", picture.name));
            write_png(&path, picture.width, picture.height, &picture.pixels)?;
        }
    }
    if let Some(path) = &args.out {
        let text = serde_json::to_string_pretty(&evaluation).expect("figures are JSON");
        write_atomic(path, (text + "\n").as_bytes())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// One line per view and their mean.
fn table(evaluation: &Evaluation) -> String {
    let width = evaluation.views.iter().map(|view| view.name.len()).max().unwrap_or(0).max(12);
    let optional = |value: Option<f64>| value.map_or("-".into(), |v| format!("{v:.4}"));
    let row = |name: &str, scores: &crate::evaluate::Scores| {
        let (ms_ssim, lpips) = (optional(scores.ms_ssim), optional(scores.lpips));
        format!("{name:width$}  {:7.2}  {:7.4}  {ms_ssim:>7}  {lpips:>7}\n", scores.psnr, scores.ssim)
    };
    let mut text = format!("{:width$}  PSNR dB     SSIM  MS-SSIM    LPIPS\n", "view");
    for view in &evaluation.views {
        text += &row(&view.name, &view.scores);
    }
    text += &row("mean", &evaluation.mean);
    if let Some(moving) = &evaluation.moving {
        text += &row("moving parts", moving);
    }
    let split = if evaluation.split == "test" { "held-out views" } else { "training views, because none are held out" };
    text += &format!("{} Gaussians, {} {split}", evaluation.gaussians, evaluation.views.len());
    if let Some(motion) = &evaluation.motion {
        text += &format!("\n{}", motion.line());
    }
    for reason in [&evaluation.ms_ssim_reason, &evaluation.lpips_reason].into_iter().flatten() {
        text += &format!("\n{reason}");
    }
    text
}
