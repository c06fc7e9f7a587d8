//! Schedules over steps, counted from 1: learning rate decay, SH degree, and intervals.

/// Exponential interpolation from `start` (step 1) to `end` (step `steps`): the learning rate of the means in 3DGS.
pub fn exponential(start: f64, end: f64, step: usize, steps: usize) -> f64 {
    let progress = (step - 1) as f64 / (steps.max(2) - 1) as f64;
    start * (end / start).powf(progress.min(1.0))
}

/// Steps of the runs that the published learning rates were found with (3DGS).
const PUBLISHED_STEPS: f64 = 30_000.0;

/// The factor on all learning rates in a run of `steps`: the root of 30,000 over `steps`, at least 1 and at most
/// `most`. Adam moves a parameter by its rate a step in whatever direction the gradients agree on, so in a short run
/// the rate limits how far it comes.
pub fn rate_factor(most: f64, steps: usize) -> f64 {
    (PUBLISHED_STEPS / steps.max(1) as f64).sqrt().min(most).max(1.0)
}

/// The active SH degree: one more every `interval` steps, from 0 up to `max`. A run too short to reach `max` that way
/// spends an equal share of its steps at each degree.
pub fn sh_degree(step: usize, interval: usize, max: usize, steps: usize) -> usize {
    let interval = interval.min(steps / (max + 1)).max(1);
    ((step - 1) / interval).min(max)
}

/// Whether an event every `every` steps (0: never) happens after `step`.
pub fn due(step: usize, every: usize) -> bool {
    every > 0 && step.is_multiple_of(every)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponential_meets_both_ends() {
        assert_eq!(exponential(1e-2, 1e-4, 1, 100), 1e-2);
        assert!((exponential(1e-2, 1e-4, 100, 100) - 1e-4).abs() < 1e-12);
        assert!((exponential(1e-2, 1e-4, 51, 101) - 1e-3).abs() < 1e-12);
        assert_eq!(exponential(1e-2, 1e-4, 1, 1), 1e-2);
    }

    #[test]
    fn short_runs_have_higher_rates() {
        let factors = [300, 7000, 15_000, 30_000, 100_000].map(|steps| rate_factor(2.0, steps));
        assert_eq!(factors, [2.0, 2.0, 2.0_f64.sqrt(), 1.0, 1.0]);
        assert_eq!(rate_factor(1.0, 300), 1.0);
    }

    #[test]
    fn sh_degree_rises_by_one() {
        let degrees: Vec<usize> = [1, 1000, 1001, 2001, 3001, 9000].map(|s| sh_degree(s, 1000, 3, 30_000)).into();
        assert_eq!(degrees, [0, 0, 1, 2, 3, 3]);
        assert_eq!(sh_degree(100, 1000, 3, 100), 3, "a short run still ends at the full degree");
        assert_eq!(sh_degree(1, 1, 0, 1), 0);
    }

    #[test]
    fn due_is_after_every_nth() {
        assert!(due(100, 100) && !due(101, 100) && !due(100, 0));
    }
}
