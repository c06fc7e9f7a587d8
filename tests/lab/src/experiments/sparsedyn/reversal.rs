//! Does a rollout forwards and then backwards return to its start? Arithmetic alone.

use anyhow::Result;

use super::analytic::{EXACT, INTEGRATORS, Linear, STEPS_PER_UNIT, difference, double, slope};
use crate::experiments::{Findings, Lab, Series, largest, smallest};

/// A way back undoes errors and adds none of a lower order, so the return's order is the method's or a higher one; the
/// rest is left for the share of the next order.
const BELOW_ORDER: f64 = 0.1;

/// The step of the recipes: two of 60 frames.
const USUAL_STEP: f64 = 1.0 / 30.0;

/// Largest distance from the start after the way there and back, shares of an object's size, for the midpoint rule at
/// that step: a tenth of the drift that is allowed there.
const RETURN_BOUND: f64 = 1e-3;

pub fn run(_: &Lab, found: &mut Findings) -> Result<()> {
    let device = double()?;
    let mut series = Vec::new();
    let mut usual = Vec::new();
    for (name, integrator, order) in INTEGRATORS {
        let off = |field: &Linear, step: f64| {
            let states = field.rolled(integrator, step, 1.0, true, &device);
            difference(&states[0], &states[1])
        };
        let fields = Linear::all();
        let curves = fields.each_ref().map(|field| STEPS_PER_UNIT.map(|n| (n.recip(), off(field, n.recip()))).to_vec());
        let slopes: Vec<f64> = curves.iter().filter_map(|curve| slope(curve)).collect();
        let what = format!("{name}: lowest order of the return");
        found.at_least(what, smallest(slopes), order - BELOW_ORDER, "");
        if name == "screw" {
            let worst = largest(curves[0].iter().map(|(_, error)| *error));
            let what = "screw: distance from the start after a steady rotation there and back, any step";
            found.at_most(what, worst, EXACT, "");
        }
        let at_usual = largest(fields.iter().map(|field| off(field, USUAL_STEP)));
        usual.push(at_usual.unwrap_or(f64::NAN));
        let worst = |index: usize| largest(curves.iter().map(|curve| curve[index].1)).unwrap_or(f64::NAN);
        let points = STEPS_PER_UNIT.iter().enumerate().map(|(i, n)| (-n.log2(), worst(i).max(1e-16).log10())).collect();
        series.push(Series::line_and_dots(name, points));
    }
    let what = "distance from the start with a step of 1/30, all integrators and motions";
    found.at_most(what, largest(usual.iter().copied()), RETURN_BOUND, "");
    let named = INTEGRATORS.iter().zip(&usual).map(|((name, ..), error)| format!("{name} {error:.1e}"));
    found.note(format!("With a step of 1/30: {}.", named.collect::<Vec<_>>().join(", ")));
    found.chart(
        "",
        "There and back: distance from the start, worst of five motions",
        ["log2 of the step", "log10 of the distance"],
        series,
    );
    Ok(())
}
