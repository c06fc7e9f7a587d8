//! Experiments at the limits of the method, on synthetic streets with exact truth.
//!
//! | file | question |
//! |---|---|
//! | [`beams`] | what do fewer beams, and other rigs, cost? |
//! | [`calibration`] | what do wrong camera poses and wrong times cost? |
//! | [`holes`] | what happens to black images, missing sweeps and nearly empty ones? |
//! | [`degree`] | which degree does the motion of traffic need? |
//! | [`baseline`] | is it better and faster than a fit of every pair of sweeps? |
//! | [`occlusion`] | does a car keep its motion that a bus hides for half of the time? |
//! | [`passes`] | what does each refinement add and cost? |
//! | [`bins`] | where in the image is the error? |
//! | [`cost`] | what do more points cost, and what do they bring? |
//! | [`weight`] | how does the weight of the mean speed trade rest against motion? |
//!
//! All but the last apply the network that ships with the program, which was trained on other streets.

pub mod baseline;
pub mod beams;
pub mod bins;
pub mod calibration;
pub mod cost;
pub mod degree;
pub mod holes;
pub mod occlusion;
pub mod passes;
mod trial;
pub mod weight;

use crate::experiments::Experiment;

/// All experiments, that with trainings last.
pub static EXPERIMENTS: [&Experiment; 10] = [
    &beams::EXPERIMENT,
    &calibration::EXPERIMENT,
    &holes::EXPERIMENT,
    &degree::EXPERIMENT,
    &occlusion::EXPERIMENT,
    &passes::EXPERIMENT,
    &bins::EXPERIMENT,
    &baseline::EXPERIMENT,
    &cost::EXPERIMENT,
    &weight::EXPERIMENT,
];
