//! A budget of time as a number of steps: the cost of a step is measured before the run, and the steps whose costs add
//! up to the budget are written into its configuration. From there on nothing asks a clock, so that a run and its
//! continuation draw the same.

use super::coarse::Coarse;
use crate::config::{Config, Strategy};

/// Most steps that a budget is turned into.
pub const STEPS_MAX: usize = 1_000_000;

/// Cost of a step over the number of Gaussians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepCost {
    /// Seconds of a step at full width without Gaussians: the cost of its pixels.
    pub pixels: f64,
    /// Seconds of each Gaussian.
    pub gaussian: f64,
}

impl StepCost {
    /// The line through two measurements, each a count and seconds. Where the costs do not rise with the count, all of
    /// it is taken to be that of the pixels.
    pub fn through((few, at_few): (usize, f64), (many, at_many): (usize, f64)) -> Self {
        let slope = (at_many - at_few) / many.saturating_sub(few).max(1) as f64;
        let slope = if many > few { slope.clamp(0.0, at_few / few.max(1) as f64) } else { 0.0 };
        Self { pixels: at_few - slope * few as f64, gaussian: slope }
    }

    /// Seconds of a step with photos whose width is halved `halvings` times.
    fn of(&self, count: usize, halvings: usize) -> f64 {
        self.pixels / f64::from(1u32 << (2 * halvings)) + self.gaussian * count as f64
    }
}

/// Seconds of a run of `steps` that begins with `count` Gaussians.
fn seconds(cost: &StepCost, mut count: usize, coarse: &Coarse, config: &Config, steps: usize) -> f64 {
    let density = &config.density;
    let interval = density.interval(steps);
    let mut sum = 0.0;
    for step in 1..=steps {
        sum += cost.of(count, coarse.halvings_in(step, steps));
        if density.strategy == Strategy::Mcmc && step % interval == 0 && density.active(step, steps) {
            count = density.grown(count, step, steps);
        }
    }
    sum
}

/// The most steps of a run that begins with `count` Gaussians and takes no more than `budget` seconds; 0 where not even
/// one fits.
pub fn steps_within(budget: f64, cost: &StepCost, count: usize, coarse: &Coarse, config: &Config) -> usize {
    let cheapest = cost.of(count.min(config.density.cap), 2);
    // No step costs less, which spares the search the long runs.
    let most = if cheapest > 0.0 { ((budget / cheapest) as usize).min(STEPS_MAX) } else { STEPS_MAX };
    let (mut fits, mut exceeds) = (0, most + 1);
    while exceeds - fits > 1 {
        let middle = fits + (exceeds - fits) / 2;
        match seconds(cost, count, coarse, config, middle) <= budget {
            true => fits = middle,
            false => exceeds = middle,
        }
    }
    fits
}

#[cfg(test)]
mod tests {
    use super::*;

    fn none() -> Coarse {
        Coarse::of(&[], 0.0, 1)
    }

    #[test]
    fn a_line_through_two_costs() {
        let cost = StepCost::through((1000, 0.2), (3000, 0.4));
        assert!((cost.pixels - 0.1).abs() < 1e-12 && (cost.gaussian - 1e-4).abs() < 1e-12);
        assert_eq!(StepCost::through((1000, 0.2), (1000, 0.3)), StepCost { pixels: 0.2, gaussian: 0.0 });
        assert_eq!(StepCost::through((1000, 0.2), (2000, 0.1)), StepCost { pixels: 0.2, gaussian: 0.0 });
        // The measurement of few was too quick: a negative cost of pixels is none.
        assert_eq!(StepCost::through((1000, 0.1), (2000, 0.5)).pixels, 0.0);
    }

    #[test]
    fn the_plan_fills_the_budget() {
        let (config, cost) = (Config::default(), StepCost { pixels: 0.02, gaussian: 2e-6 });
        for budget in [10.0, 60.0, 600.0] {
            let steps = steps_within(budget, &cost, 50_000, &none(), &config);
            let [now, next] = [steps, steps + 1].map(|steps| seconds(&cost, 50_000, &none(), &config, steps));
            assert!(now <= budget && next > budget, "{steps} steps take {now} s, one more {next} s");
            // Between the cost at the start and at the cap.
            assert!((budget / 0.22..budget / 0.12).contains(&(steps as f64)), "{steps}");
        }
        assert_eq!(steps_within(0.1, &cost, 50_000, &none(), &config), 0);
    }

    #[test]
    fn a_count_that_is_fixed_costs_the_same_throughout() {
        let mut config = Config::default();
        config.density.strategy = Strategy::None;
        let cost = StepCost { pixels: 0.1, gaussian: 0.0 };
        assert_eq!(steps_within(10.05, &cost, 100, &none(), &config), 100);
    }
}
