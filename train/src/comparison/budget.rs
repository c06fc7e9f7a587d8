//! How many Gaussians are enough: the smallest cap that is as good as the best, as far as the held-out views can tell.
//!
//! "As good" is within one standard error of the mean PSNR over held-out views (the rule of Breiman et al. 1984 for pruning
//! trees), of moving parts where they were measured. Only runs that differ in nothing but their cap are compared.

use super::ComparedRun;
use crate::evaluate::Evaluation;

/// The verdict on runs that differ in their cap alone, at least two; else `None`. In one sentence.
pub fn enough(runs: &[ComparedRun]) -> Option<String> {
    let mut ladder: Vec<(usize, &Evaluation)> = runs.iter().map(|run| (run.eval.cap, &run.eval.last)).collect();
    ladder.sort_by_key(|(cap, _)| *cap);
    let rest = |run: &ComparedRun| {
        let mut values = run.values.clone();
        values.remove("density.cap");
        values
    };
    let alike =
        runs.windows(2).all(|pair| rest(&pair[0]) == rest(&pair[1]) && pair[0].eval.dataset == pair[1].eval.dataset);
    let caps: Vec<usize> = ladder.iter().map(|(cap, _)| *cap).collect();
    if !alike || runs.len() < 2 || caps.windows(2).any(|pair| pair[0] == pair[1]) {
        return None;
    }
    if figures_missing(&ladder) {
        return None;
    }
    let moving = ladder.iter().all(|(_, e)| e.moving.is_some());
    let figures: Vec<(usize, f64, f64)> = ladder.iter().filter_map(|(cap, e)| figure(*cap, e, moving)).collect();
    let best = figures.iter().copied().reduce(|a, b| if b.1 > a.1 { b } else { a })?;
    let least = figures.iter().find(|(_, psnr, _)| *psnr >= best.1 - best.2)?;
    let of = if moving { " of moving parts" } else { "" };
    Some(format!(
        "budget: a cap of {} is enough: {:.2} dB{of}, within one standard error ({:.2} dB over the held-out views) of the best, \
         {:.2} dB at {}",
        least.0, least.1, best.2, best.1, best.0
    ))
}

/// Whether any run was not measured on at least two held-out views.
fn figures_missing(ladder: &[(usize, &Evaluation)]) -> bool {
    ladder.iter().any(|(_, e)| e.split != "test" || e.views.len() < 2)
}

/// Cap, mean PSNR over views and its standard error; `None` with fewer than two views, which have none.
fn figure(cap: usize, evaluation: &Evaluation, moving: bool) -> Option<(usize, f64, f64)> {
    let of = |view: &crate::evaluate::ViewScores| match moving {
        true => view.moving.as_ref().map(|scores| scores.psnr),
        false => Some(view.scores.psnr),
    };
    let values: Vec<f64> = evaluation.views.iter().filter_map(of).filter(|psnr| psnr.is_finite()).collect();
    if values.len() < 2 {
        return None;
    }
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (count - 1.0);
    Some((cap, mean, (variance / count).sqrt()))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::evaluate::{Scores, ViewScores};
    use crate::run_folder::{EvalFile, RunFolder};

    fn run(cap: usize, psnr: [f64; 4], seed: &str) -> ComparedRun {
        let scores = |psnr| Scores { psnr, ssim: 0.9, ms_ssim: None, lpips: None };
        let views = psnr.map(|psnr| ViewScores { name: "v".into(), scores: scores(psnr), moving: None });
        let last = Evaluation {
            step: 10,
            split: "test".into(),
            mean: scores(psnr.iter().sum::<f64>() / 4.0),
            moving: None,
            motion: None,
            lpips_network: None,
            lpips_reason: None,
            ms_ssim_reason: None,
            gaussians: cap,
            bytes: 0,
            seconds: 1.0,
            cpu_seconds: None,
            peak_memory_bytes: None,
            views: views.to_vec(),
        };
        let eval = EvalFile {
            name: "run".into(),
            dataset: "data".into(),
            device: "cpu".into(),
            steps: 10,
            cap,
            skipped_steps: 0,
            predicted_memory_bytes: 0,
            total_seconds: 1.0,
            last,
            evaluations: Vec::new(),
        };
        let values = BTreeMap::from([("density.cap".into(), cap.to_string()), ("seed".into(), seed.into())]);
        ComparedRun { name: "run".into(), folder: RunFolder::at("run"), values, eval }
    }

    #[test]
    fn the_smallest_that_views_cannot_tell_from_the_best() {
        // The deviation of 28, 30, 32, 34 is 2.58 dB, a half of that the standard error of their mean.
        let ladder = [
            run(40_000, [28.0, 30.0, 32.0, 34.0], "1"),
            run(10_000, [26.0, 28.0, 30.0, 32.0], "1"),
            run(20_000, [27.5, 29.5, 31.5, 33.5], "1"),
        ];
        let verdict = enough(&ladder).expect("a ladder");
        assert!(
            verdict.starts_with("budget: a cap of 20000 is enough: 30.50 dB, within one standard error (1.29 dB"),
            "{verdict}"
        );
    }

    #[test]
    fn other_differences_and_single_runs_say_nothing() {
        let psnr = [28.0, 30.0, 32.0, 34.0];
        assert!(enough(&[run(1, psnr, "1"), run(2, psnr, "2")]).is_none());
        assert!(enough(&[run(1, psnr, "1")]).is_none());
        assert!(enough(&[run(1, psnr, "1"), run(1, psnr, "1")]).is_none());
        assert!(enough(&[]).is_none());
    }
}
