//! The update of the dynamics field and the bodies.

use gs_burn::NamedGradients;
use gs_burn::adam::{Adam, AdamRate};

use super::cues::warmup_steps;
use super::{Sparsedyn, Step};
use crate::fit::schedule::exponential;

impl Sparsedyn {
    /// One Adam update of the field; none in the warm-up.
    pub(super) fn updated(self, gradients: &mut NamedGradients, adam: &mut Adam, at: &Step) -> Self {
        let warmup = warmup_steps(at.config);
        if at.step <= warmup {
            return self;
        }
        let (dynamics, bodies) = (&at.config.method.dynamics, &at.config.method.bodies);
        let (step, steps) = (at.step - warmup, at.config.steps - warmup);
        let field = exponential(dynamics.lr, dynamics.lr_final, step, steps);
        let begun = (bodies.from * steps as f64) as usize;
        let body =
            exponential(bodies.lr, bodies.lr_final, step.saturating_sub(begun).max(1), steps - begun.min(steps - 1));
        let rate = |path: &str| if path.starts_with("method.bodies.") { body } else { field };
        adam.update_under("method", self, gradients, |path| Some(AdamRate::new(rate(path))))
    }
}

/// Forgets the moments of the bodies' numbers: they belong to numbers of another meaning once bodies change.
pub fn forget(adam: &mut Adam) {
    for path in ["method.bodies.numbers", "method.bodies.corrections"] {
        adam.forget(path);
    }
}
