//! How far does a rollout drift on motions that are known exactly, and which step keeps it within 1 %? Arithmetic
//! alone.

use std::f64::consts::TAU;

use anyhow::Result;
use burn::tensor::Device;
use gs_models::sparsedyn::Integrator;

use super::analytic::{EXACT, INTEGRATORS, Linear, STEPS_PER_UNIT, double, positions, radius, slope, starts};
use crate::experiments::{Findings, Lab, Series, largest, smallest};

/// Largest difference of a measured order from that of the method: halving the step leaves about this much of the next
/// order.
const ORDER_BOUND: f64 = 0.1;

/// Largest growth of a radius: a hundredth of an object's size is under a pixel in images of some hundred pixels.
const DRIFT_BOUND: f64 = 0.01;

/// Angular speeds, radians per unit of time: from a slow turn to six turns.
const SPEEDS: [f64; 8] = [1.0, 2.0, 4.0, TAU, 10.0, 15.0, 20.0, 40.0];

/// Horizons over which the step rule is held to its word, units of time.
const HORIZONS: [f64; 3] = [1.0, 2.0, 5.0];

/// Factor of the rule's step at which the drift must be above the bound, or the rule would ask for needless steps: the
/// drift grows with the third power of the step, so by 3.4.
const TOO_LONG: f64 = 1.5;

/// Drifts between the kinds of dots of the figure, with their names.
const CLASSES: [(&str, f64); 4] =
    [("below 0.1 %", 1e-3), ("0.1 to 1 %", 1e-2), ("1 to 10 %", 1e-1), ("above 10 %", f64::INFINITY)];

/// The longest step that keeps a radius within the bound over `horizon` at `w` radians per unit of time: a step of the
/// midpoint rule multiplies the radius by `sqrt(1 + (w h)^4 / 4)`, so over the horizon by `exp(w^4 h^3 T / 8)` at most.
fn step_rule(w: f64, horizon: f64) -> f64 {
    (8.0 * (1.0 + DRIFT_BOUND).ln() / (w.powi(4) * horizon)).cbrt()
}

pub fn run(_: &Lab, found: &mut Findings) -> Result<()> {
    let device = double()?;
    let mut curves = Vec::new();
    for (name, integrator, order) in INTEGRATORS {
        let mut off = Vec::new();
        for field in Linear::all() {
            let errors = errors(&field, integrator, &device);
            match slope(&errors) {
                Some(slope) => {
                    off.push((slope - order).abs());
                    found.note(format!("{name}, {}: order {slope:.3}.", field.name));
                }
                None => found.note(format!("{name}, {}: exact.", field.name)),
            }
            if field.name == "shear and rotation" {
                let logs = errors.iter().map(|(step, error)| (step.log2(), error.max(1e-16).log10())).collect();
                curves.push(Series::line_and_dots(name, logs));
            }
            if integrator == Integrator::Screw && field.name == "rotation" {
                let worst = largest(errors.iter().map(|(_, error)| *error));
                let what = "screw: error on a steady rotation after 1 unit of time, any step";
                found.at_most(what, worst, EXACT, "");
            }
        }
        let what = format!("{name}: largest difference of a measured order from {order}");
        found.at_most(what, largest(off), ORDER_BOUND, "");
    }
    rule(found, &device);
    found.chart(
        "order",
        "Error after 1 unit of time, shear and rotation at 2 rad",
        ["log2 of the step", "log10 of the error"],
        curves,
    );
    drift_chart(found, &device);
    Ok(())
}

/// The largest error of a position at time 1 by step.
fn errors(field: &Linear, integrator: Integrator, device: &Device) -> Vec<(f64, f64)> {
    let error = |count: f64| {
        let end = &field.rolled(integrator, count.recip(), 1.0, false, device)[1];
        let truth = starts().map(|first| field.position(first, 1.0));
        let off = positions(end).into_iter().zip(truth).map(|(found, truth)| found.distance(truth));
        (count.recip(), off.fold(0.0, f64::max))
    };
    STEPS_PER_UNIT.map(error).to_vec()
}

/// Relative growth of a radius over `horizon` by the midpoint rule.
fn drift(w: f64, step: f64, horizon: f64, device: &Device) -> f64 {
    let states = Linear::rotation(w).rolled(Integrator::Rk2, step, horizon, false, device);
    let [before, after] = [0, 1].map(|index| radius(positions(&states[index])[0]));
    after / before - 1.0
}

/// The bounds on the step rule.
fn rule(found: &mut Findings, device: &Device) {
    let at =
        |factor: f64, horizon: f64| SPEEDS.map(|w| 100.0 * drift(w, factor * step_rule(w, horizon), horizon, device));
    let kept = largest(HORIZONS.iter().flat_map(|horizon| at(1.0, *horizon)));
    let what = "rk2: growth of a radius with the step of the rule, 1 to 40 rad, over 1, 2 and 5 units of time";
    found.at_most(what, kept, 100.0 * DRIFT_BOUND, "%");
    let wasteful = smallest(at(TOO_LONG, 1.0));
    let what = format!("rk2: the same with {TOO_LONG} times that step");
    found.above(what, wasteful, 100.0 * DRIFT_BOUND, "%");
    let usual = 1.0_f64 / 30.0;
    let fastest = (8.0 * (1.0 + DRIFT_BOUND).ln() / usual.powi(3)).powf(0.25);
    found.note(format!(
        "With the paper's step (two of 60 frames) the midpoint rule keeps 1 % over 1 unit of time up to {fastest:.1} \
         rad; at 20 rad a radius grows by {:.0} %.",
        100.0 * drift(20.0, usual, 1.0, device)
    ));
}

/// Drift over step and angular speed: a dot for each pair, coloured by its size, with the contour and the rule.
fn drift_chart(found: &mut Findings, device: &Device) {
    let mut classes = CLASSES.map(|_| Vec::new());
    let mut contour = Vec::new();
    for w in SPEEDS {
        let drifts: Vec<(f64, f64)> =
            STEPS_PER_UNIT.iter().map(|n| (n.log2(), drift(w, n.recip(), 1.0, device).max(1e-16))).collect();
        for (steps, drift) in &drifts {
            let class = CLASSES.iter().position(|(_, most)| drift < most).unwrap_or(CLASSES.len() - 1);
            classes[class].push((*steps, w.log2()));
        }
        let crossing = drifts.windows(2).find(|pair| pair[0].1 >= DRIFT_BOUND && pair[1].1 < DRIFT_BOUND);
        contour.extend(crossing.map(|pair| {
            let [high, low] = [pair[0].1.ln(), pair[1].1.ln()];
            let share = (high - DRIFT_BOUND.ln()) / (high - low);
            (pair[0].0 + share * (pair[1].0 - pair[0].0), w.log2())
        }));
    }
    let named = CLASSES.iter().zip(classes);
    let mut series: Vec<Series> = named.map(|((name, _), points)| Series::dots(name, points)).collect();
    let rule = SPEEDS.map(|w| (-step_rule(w, 1.0).log2(), w.log2()));
    let coarsest = STEPS_PER_UNIT[0].log2();
    let rule = rule.into_iter().filter(|(steps, _)| *steps >= coarsest).collect();
    series.push(Series::line("1 %, step rule", rule));
    series.push(Series::line_and_dots("1 %, measured", contour));
    let title = "Growth of a radius over 1 unit of time, midpoint rule";
    let axes = ["log2 of the steps per unit of time", "log2 of the angular speed, rad"];
    found.chart("drift", title, axes, series);
}
