//! The budget: the smallest cap that is as good as the best, within the precision of the held-out views.
//!
//! "As good" is within one standard error of the mean PSNR over held-out views (the rule of Breiman et al. 1984 for
//! pruning trees); the PSNR is that of moving parts if they were measured. Only runs that differ in their cap alone are
//! compared.

use super::ComparedRun;
use super::choice::mean_and_error;
use gs_train::fit::told::MOVING;
use gs_train::run::measured::{Evaluation, ViewScores};

/// The key of the cap.
const CAP: &str = "density.cap";

/// With fewer held-out views the standard error is itself known no better than to a half of it (chi-squared with three
/// degrees of freedom), and the verdict says how few they are.
const VIEWS_MIN: usize = 4;

/// The verdict on runs that differ in their cap alone, at least two; else `None`. In one sentence.
pub fn enough(runs: &[ComparedRun]) -> Option<String> {
    let mut ladder: Vec<(usize, &Evaluation)> =
        runs.iter().filter_map(|run| Some((run.values.get(CAP)?.parse().ok()?, &run.eval.last))).collect();
    ladder.sort_by_key(|(cap, _)| *cap);
    let rest = |run: &ComparedRun| {
        let mut values = run.values.clone();
        values.remove(CAP);
        values
    };
    let alike =
        runs.windows(2).all(|pair| rest(&pair[0]) == rest(&pair[1]) && pair[0].eval.dataset == pair[1].eval.dataset);
    let caps: Vec<usize> = ladder.iter().map(|(cap, _)| *cap).collect();
    if !alike || runs.len() < 2 || caps.len() < runs.len() || caps.windows(2).any(|pair| pair[0] == pair[1]) {
        return None;
    }
    if figures_missing(&ladder) {
        return None;
    }
    let moving = ladder.iter().all(|(_, e)| e.moving().is_some());
    let figures: Vec<(usize, f64, f64)> = ladder.iter().filter_map(|(cap, e)| figure(*cap, e, moving)).collect();
    let best = figures.iter().copied().reduce(|a, b| if b.1 > a.1 { b } else { a })?;
    let least = figures.iter().find(|(_, psnr, _)| *psnr >= best.1 - best.2)?;
    let of = if moving { " of moving parts" } else { "" };
    let views = ladder.iter().map(|(_, e)| e.measured.quality.views.len()).min().unwrap_or(0);
    let few = match views < VIEWS_MIN {
        true => format!("; {views} held-out views are few to tell by"),
        false => String::new(),
    };
    let within = format!("within one standard error ({:.2} dB over {views} held-out views) of the best", best.2);
    // A cap that the run never reached did not hold it back, and says nothing.
    let reached = runs.iter().find(|run| run.values.get(CAP).is_some_and(|cap| *cap == least.0.to_string()))?;
    // Runs of older versions did not keep it.
    let reached = reached.eval.most_gaussians.unwrap_or(least.0);
    if reached < least.0 {
        return Some(format!(
            "budget: no cap is needed: the run with a cap of {} stopped at {reached} Gaussians by itself, {:.2} \
             dB{of}, {within}, {:.2} dB at {}{few}",
            least.0, least.1, best.1, best.0
        ));
    }
    Some(format!(
        "budget: a cap of {} is enough: {:.2} dB{of}, {within}, {:.2} dB at {}{few}",
        least.0, least.1, best.1, best.0
    ))
}

/// Whether any run was not measured on at least two held-out views.
fn figures_missing(ladder: &[(usize, &Evaluation)]) -> bool {
    ladder.iter().any(|(_, e)| e.measured.split == "train" || e.measured.quality.views.len() < 2)
}

/// Cap, mean PSNR over views and its standard error; `None` with fewer than two views, for which it is undefined.
fn figure(cap: usize, evaluation: &Evaluation, moving: bool) -> Option<(usize, f64, f64)> {
    let of = |view: &ViewScores| match moving {
        true => view.regions.get(MOVING).map(|scores| scores.psnr),
        false => Some(view.scores.psnr),
    };
    let values: Vec<f64> = evaluation.measured.quality.views.iter().filter_map(of).collect();
    let (mean, error) = mean_and_error(&values);
    mean.is_finite().then_some((cap, mean, error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_train::run::folder::RunFolder;
    use gs_train::run::measured::Scores;

    /// The figures of a run without views.
    const EVAL: &str = r#"{
        "name": "run", "dataset": "world", "device": "flex", "pipeline": "static", "steps": 10, "skipped_steps": 0,
        "predicted_memory_bytes": 0, "total_seconds": 0, "step": 10, "split": "test", "psnr": 0, "ssim": 0.9,
        "compared": "photo", "views": [], "gaussians": 100, "bytes": 4400, "seconds": 1, "evaluations": []
    }"#;

    fn run(cap: usize, psnr: [f64; 4], seed: &str) -> ComparedRun {
        let eval = serde_json::from_str(EVAL).expect("a file of figures");
        let folder = RunFolder::at("run");
        let mut run = ComparedRun { name: "run".into(), folder, values: Default::default(), eval };
        let scores = |psnr| Scores { psnr, ssim: 0.9, ms_ssim: None, lpips: None };
        let view = |psnr| ViewScores { name: "v".into(), scores: scores(psnr), regions: Default::default() };
        run.eval.last.measured.quality.views = psnr.map(view).to_vec();
        run.values = [(CAP.to_string(), cap.to_string()), ("seed".to_string(), seed.to_string())].into();
        run
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
    fn a_cap_that_no_run_reached_is_not_recommended() {
        let psnr = [28.0, 30.0, 32.0, 34.0];
        let mut ladder = [run(10_000, psnr, "1"), run(20_000, psnr, "1")];
        ladder.iter_mut().for_each(|run| run.eval.most_gaussians = Some(7_000));
        let verdict = enough(&ladder).expect("a ladder");
        assert!(
            verdict.starts_with("budget: no cap is needed: the run with a cap of 10000 stopped at 7000"),
            "{verdict}"
        );
    }

    #[test]
    fn two_views_are_called_few() {
        let mut ladder = [run(1, [28.0, 30.0, 32.0, 34.0], "1"), run(2, [28.0, 30.0, 32.0, 34.0], "1")];
        ladder.iter_mut().for_each(|run| run.eval.last.measured.quality.views.truncate(2));
        let verdict = enough(&ladder).expect("a ladder");
        assert!(verdict.ends_with("2 held-out views are few to tell by"), "{verdict}");
    }

    #[test]
    fn other_differences_and_single_runs_say_nothing() {
        let psnr = [28.0, 30.0, 32.0, 34.0];
        assert!(enough(&[run(1, psnr, "1"), run(2, psnr, "2")]).is_none());
        assert!(enough(&[run(1, psnr, "1")]).is_none());
        let on = |split: &str| {
            let mut ladder = [run(1, psnr, "1"), run(2, psnr, "1")];
            ladder.iter_mut().for_each(|run| run.eval.last.measured.split = split.into());
            enough(&ladder)
        };
        assert!(on("train").is_none() && on("validation").is_some());
        assert!(enough(&[run(1, psnr, "1"), run(1, psnr, "1")]).is_none());
        assert!(enough(&[]).is_none());
    }
}
