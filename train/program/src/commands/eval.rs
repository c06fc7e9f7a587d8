//! `gsburn eval`.

use std::process::ExitCode;

use anyhow::{Result, bail};
use gs_base::counted;
use serde::Serialize;

use crate::cli::EvalArgs;
use crate::commands::train::resolve;
use crate::commands::{device, missing, print};
use crate::report::pictures::SideBySide;
use gs_pipelines::{EvalRequest, Evaluated, find, of_checkpoint, resolve_changed};
use gs_train::config::tables;
use gs_train::run::measured::{Measured, Scores, described_split};
use gs_train::run::metrics::psnr_cell;
use gs_train::run::outputs::{self, MARK, check_one, write_json, write_png};
use gs_train::run::resources::peak_memory;
use gs_train::run::scene::{SceneFile, read_file};

/// The content of `eval --out`.
#[derive(Debug, Serialize)]
struct Figures {
    /// [`MARK`], so that a later measurement may write over the file.
    program: &'static str,
    /// Steps that the scene was trained.
    step: usize,
    #[serde(flatten)]
    measured: Measured,
    /// Peak resident memory of the measurement, bytes.
    peak_memory_bytes: Option<u64>,
}

/// Measures a scene on the held-out views of its data set.
///
/// # Errors
/// One sentence saying what was wrong with the scene or the data set.
pub fn run(args: &EvalArgs) -> Result<ExitCode> {
    args.out.as_deref().map_or(Ok(()), check_one)?;
    let device = device(&args.device)?;
    let file = read_file(&args.scene)?;
    let (pipeline, resolved) = match &file {
        SceneFile::Checkpoint(_) if args.config.config.is_some() || args.config.recipe.is_some() => {
            bail!("{}: a run has its own configuration; leave out --config and --recipe", args.scene.display())
        }
        SceneFile::Checkpoint(checkpoint) => {
            let origin = format!("{}: configuration", checkpoint.path.display());
            let config = tables::parse(&checkpoint.origin.config, &origin)?;
            (of_checkpoint(checkpoint)?, resolve_changed(&config, &origin, &args.config.set)?)
        }
        SceneFile::Ply(_) => {
            let resolved = resolve(&args.config, &[])?;
            (find(resolved.pipeline.name()).expect("a resolved pipeline is one of the list"), resolved)
        }
    };
    let known = match &file {
        SceneFile::Checkpoint(checkpoint) => Some(checkpoint.origin.dataset.clone()),
        SceneFile::Ply(_) => None,
    };
    let Some(dataset) = args.data.clone().or(known) else {
        bail!("{}: a PLY file does not know its data set; name it with --data", args.scene.display());
    };
    let Evaluated { step, measured, pictures } = pipeline.evaluate(&EvalRequest {
        file: &file,
        dataset: &dataset,
        config: &resolved.config,
        split: args.split.as_deref(),
        device: &device,
        pictures: args.renders.is_some(),
    })?;

    // Printed before files are written: a full disk must not cost the figures.
    print(table(&measured));
    if let Some(folder) = &args.renders {
        let path = |picture: &SideBySide| folder.join(format!("{}.png", picture.name));
        let pictures: Vec<SideBySide> = pictures.iter().map(SideBySide::new).collect();
        outputs::check(&pictures.iter().map(path).collect::<Vec<_>>(), &[])?;
        for picture in &pictures {
            write_png(&path(picture), [picture.width, picture.height], &picture.pixels)?;
        }
    }
    if let Some(path) = &args.out {
        write_json(path, &Figures { program: MARK, step, measured, peak_memory_bytes: peak_memory() })?;
    }
    Ok(ExitCode::SUCCESS)
}

/// One row per view, and the mean.
fn table(measured: &Measured) -> String {
    let quality = &measured.quality;
    let width = quality.views.iter().map(|view| view.name.len()).max().unwrap_or(0).max(12);
    let optional = |value: Option<f64>| value.map_or("-".into(), |v| format!("{v:.4}"));
    let row = |name: &str, scores: &Scores| {
        let (ms_ssim, lpips) = (optional(scores.ms_ssim), optional(scores.lpips));
        format!("{name:width$}  {:>7}  {:7.4}  {ms_ssim:>7}  {lpips:>7}\n", psnr_cell(scores.psnr), scores.ssim)
    };
    let mut text = format!("{:width$}  PSNR dB     SSIM  MS-SSIM    LPIPS\n", "view");
    for view in &quality.views {
        text += &row(&view.name, &view.scores);
    }
    text += &row("mean", &quality.mean);
    text += &format!("{:width$}  {:>7}\n", "mean error", psnr_cell(quality.psnr_of_mean_error));
    for (name, scores) in &quality.regions {
        text += &row(&format!("{name} parts"), scores);
    }
    let why = if measured.split == "train" { ", because none are held out or they were asked for" } else { "" };
    text += &format!(
        "{}, {}{why}",
        counted(measured.size.gaussians, "Gaussian"),
        described_split(&measured.split, quality.views.len())
    );
    text.extend(quality.nothing_to_tell().map(|why| format!("\n{why}")));
    if quality.compared == "formed blur" {
        text +=
            "\nthe photos are blurry and no sharp truth is known: each is compared with the blur that the scene forms";
    }
    if quality.regions_inferred {
        text += "\nthe data set marks no moving parts in these photos: they were found where the photos change";
    }
    text.extend(measured.figures_line().map(|line| format!("\n{line}")));
    for reason in missing(quality) {
        text += &format!("\n{reason}");
    }
    text
}
