//! Experiments at the limits of the method, on synthetic streets with exact truth.
//!
//! | file | question |
//! |---|---|
//! | [`along`] | costs of beams, images, wrong poses and times, degrees, refinements, a weight |
//! | [`holes`] | black images, missing sweeps and nearly empty ones |
//! | [`occlusion`] | does a car keep its motion that a bus hides for half of the time? |
//! | [`bins`] | where in the image is the error? |
//! | [`baseline`] | is it better and faster than a fit of every pair of sweeps? |
//! | [`cost`] | costs and gains of more points |
//!
//! All but the weight of the mean speed apply the network that ships with the program, which was trained on other
//! streets.

mod along;
mod baseline;
mod bins;
mod cost;
mod holes;
mod occlusion;
mod trial;

use crate::experiments::Experiment;

/// All experiments, that with trainings last.
pub static EXPERIMENTS: [&Experiment; 10] = [
    &along::BEAMS,
    &along::CALIBRATION,
    &holes::EXPERIMENT,
    &along::DEGREE,
    &occlusion::EXPERIMENT,
    &along::PASSES,
    &bins::EXPERIMENT,
    &baseline::EXPERIMENT,
    &cost::EXPERIMENT,
    &along::WEIGHT,
];
