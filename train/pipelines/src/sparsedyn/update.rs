//! The update of the dynamics field and the bodies.

use gs_burn::NamedGradients;
use gs_burn::adam::{Adam, AdamRate};

use super::count::{bodies_at, laws_at};
use super::cues::warmup_steps;
use super::{Config, Sparsedyn, Step};
use gs_train::fit::schedule::exponential;

/// The learning rate of oscillations' rates is this many times that of other numbers: a rate is some radians per unit
/// of time, other numbers are tenths of a body.
const RATES_FASTER: f64 = 30.0;

/// Learning rate of the bodies' numbers at the last step, the same as the field's.
const LR_FINAL: f64 = 2e-5;

impl Sparsedyn {
    /// One Adam update of the field; none in the warm-up.
    pub(super) fn updated(self, gradients: &mut NamedGradients, adam: &mut Adam, at: &Step) -> Self {
        let warmup = warmup_steps(at.config);
        if at.step <= warmup {
            return self;
        }
        let dynamics = &at.config.method.dynamics;
        let field = exponential(dynamics.lr, dynamics.lr_final, at.step - warmup, at.config.steps - warmup);
        let body = body_rate(at.step, at.config);
        let rate = |path: &str| match path {
            "method.bodies.rates" => RATES_FASTER * body,
            path if path.starts_with("method.bodies.") => body,
            _ => field,
        };
        adam.update_under("method", self, gradients, |path| Some(AdamRate::new(rate(path))))
    }
}

/// The learning rate of the bodies' numbers at a step after the warm-up. It falls from the first search for bodies to
/// the last step, and once more from the choice of laws: a law's numbers are new, and poses leave them further from the
/// photos than what is left of the first fall can go. A pendulum whose rate of oscillation was 1 and 3 % off at the
/// choice was 34 and 10 % of its angle off at time 1 with one fall, and less than 2 % with two.
fn body_rate(step: usize, config: &Config) -> f64 {
    let (bodies, laws) = (&config.method.bodies, laws_at(config));
    let begun = if step > laws { laws } else { bodies_at(config) };
    let steps = config.steps.saturating_sub(begun).max(1);
    exponential(bodies.lr, LR_FINAL, step.saturating_sub(begun).max(1), steps)
}

/// Forgets the moments of the bodies' numbers: they belong to numbers of another meaning once bodies change.
pub fn forget(adam: &mut Adam) {
    for path in ["method.bodies.numbers", "method.bodies.free", "method.bodies.nodes", "method.bodies.rates"] {
        adam.forget(path);
    }
}

#[cfg(test)]
mod tests {
    use super::super::config::defaults;
    use super::*;

    #[test]
    fn the_rate_of_bodies_begins_again_with_their_laws() {
        let config = defaults();
        let (bodies, laws) = (&config.method.bodies, laws_at(&config));
        assert!(body_rate(laws, &config) < 0.1 * bodies.lr);
        assert!(body_rate(laws + 1, &config) > 0.99 * bodies.lr);
        assert!((body_rate(config.steps, &config) - LR_FINAL).abs() < 1e-12);
        let rates: Vec<f64> = (laws + 1..=config.steps).map(|step| body_rate(step, &config)).collect();
        assert!(rates.windows(2).all(|pair| pair[1] < pair[0]));
    }
}
