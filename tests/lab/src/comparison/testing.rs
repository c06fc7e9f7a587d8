//! Hand-made runs for tests.

use gs_train::fit::told::MOVING;
use gs_train::run::folder::{EvalFile, RunFolder, Setting};
use gs_train::run::measured::{Cost, Evaluation, Measured, ModelSize, Quality, Scores};
use gsburn::report::comparison::ComparedRun;

/// A setting.
pub fn setting(name: &str, key: &str, value: &str, label: &str) -> Setting {
    Setting { name: name.into(), key: key.into(), value: value.into(), label: label.into() }
}

/// A finished run of one measurement; `moving` is the PSNR of its moving parts.
pub fn run(name: &str, psnr: f64, moving: Option<f64>) -> ComparedRun {
    let scores = |psnr| Scores { psnr, ssim: 0.9, ms_ssim: None, lpips: None };
    let quality = Quality {
        mean: scores(psnr),
        regions: moving.map(|psnr| (MOVING.to_string(), scores(psnr))).into_iter().collect(),
        ..Quality::default()
    };
    let evaluation = Evaluation {
        step: 10,
        measured: Measured {
            split: "test".into(),
            quality,
            size: ModelSize { gaussians: 100, bytes: 4400 },
            ..Measured::default()
        },
        cost: Cost { seconds: 2.0 * psnr, cpu_seconds: Some(psnr), peak_memory_bytes: None },
    };
    ComparedRun {
        name: name.into(),
        folder: RunFolder::at(name),
        values: Default::default(),
        eval: EvalFile {
            name: name.into(),
            dataset: "world".into(),
            device: "flex".into(),
            pipeline: "static".into(),
            steps: 10,
            most_gaussians: None,
            skipped_steps: 0,
            predicted_memory_bytes: 0,
            total_seconds: 0.0,
            facts: Vec::new(),
            settings: Vec::new(),
            last: evaluation.clone(),
            evaluations: vec![evaluation],
        },
    }
}
