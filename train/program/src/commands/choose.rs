//! `gsburn sweep --choose`: the runs of a sweep measured on a split that is not reported, and the model that it
//! chooses.

use anyhow::{Result, bail};
use burn::tensor::Device;
use gs_base::write_atomic;
use gs_datasets::Split;

use crate::commands::planned::Sweep;
use crate::commands::print;
use crate::report::comparison::{Candidate, Choice, ComparedRun, by_cpu, seconds};
use gs_pipelines::{EvalRequest, Resolved, resolve_changed};
use gs_train::run::outputs;
use gs_train::run::scene::read_file;

/// The table of a choice in the folder of a sweep.
pub const FILE: &str = "choice.md";

/// Measures that a choice does not need.
const LEFT_OUT: [&str; 2] = ["eval.lpips=false", "eval.ms_ssim=false"];

/// Checks that a split can choose: the data set has it, and figures are reported on another one.
///
/// # Errors
/// One sentence.
pub(super) fn check_split(sweep: &Sweep, config: &Resolved) -> Result<()> {
    let report = config.pipeline.check(sweep.dataset, &config.config)?;
    if !report.is_ok() {
        // Training says what is wrong with the data set.
        return Ok(());
    }
    let names: Vec<&str> = report.held_out.iter().map(|(name, _)| name.as_str()).collect();
    let reported = [Split::TEST, Split::VALIDATION].into_iter().find(|name| names.contains(name));
    let reported = reported.or(names.first().copied());
    let (by, data) = (sweep.args.choose_by.as_str(), sweep.dataset.display());
    if reported == Some(by) {
        bail!(
            "{data}: expected a split to choose by that is not the reported one, found only {by}; data.train_cameras \
             and data.seen make validation and test out of cameras that film, a list of the data set does so otherwise"
        );
    }
    if !names.contains(&by) {
        let found = if names.is_empty() { "none".to_string() } else { names.join(", ") };
        bail!("{data}: expected a held-out split {by:?} to choose by, found {found}");
    }
    Ok(())
}

/// Measures the finished runs of a sweep on the split, chooses, prints the choice and writes its table into the folder
/// of the sweep.
///
/// # Errors
/// One sentence: a run that cannot be measured, a full disk.
pub(super) fn choose(sweep: &Sweep, runs: &[ComparedRun], device: &Device) -> Result<()> {
    let (cpu, by) = (by_cpu(runs), &sweep.args.choose_by);
    let left_out = LEFT_OUT.map(String::from);
    let mut candidates = Vec::with_capacity(runs.len());
    for run in runs {
        let own = sweep.runs.iter().find(|planned| planned.folder.path() == run.folder.path());
        let Some(resolved) = own.map(|planned| &planned.config) else { continue };
        let config = resolve_changed(&resolved.config, "config.toml", &left_out)?;
        let file = read_file(run.folder.path())?;
        let evaluated = resolved.pipeline.evaluate(&EvalRequest {
            file: &file,
            dataset: sweep.dataset,
            config: &config.config,
            split: Some(by),
            device,
            pictures: false,
        })?;
        let measured = &run.eval.last.measured;
        candidates.push(Candidate {
            name: run.name.clone(),
            scores: evaluated.measured.quality.views.iter().map(|view| view.scores.psnr).collect(),
            reported: measured.quality.mean.psnr,
            gaussians: measured.size.gaussians,
            bytes: measured.size.bytes,
            seconds: seconds(&run.eval.last, cpu),
        });
    }
    let Some(choice) = Choice::smallest(candidates, by) else {
        bail!("{}: expected at least 2 images in the split {by} to choose by", sweep.dataset.display());
    };
    let (table, sentence) = (choice.table(), choice.sentence());
    print(format!("\n{}\n{sentence}", table.text()));
    let path = sweep.out.join(FILE);
    write_atomic(&path, outputs::marked_markdown(&format!("{}\n{sentence}\n", table.markdown())).as_bytes())?;
    print(format!("choice {}", path.display()));
    Ok(())
}
