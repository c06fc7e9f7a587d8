//! Experiments at the limits of the method.
//!
//! | file | question |
//! |---|---|
//! | [`integrators`] | how far does a rollout drift on motions that are known exactly? |
//! | [`reversal`] | does a rollout forwards and backwards return? |
//! | [`horizon`] | what is left at four times the time that was seen? |
//! | [`views`] | how many Gaussians and colours do few cameras determine? |
//! | [`priors`] | what do wrong depth priors cost? |
//! | [`seeds`] | how far do runs spread that differ by the seed alone? |
//! | [`observed`] | how much of a motion must be seen? |
//! | [`step`] | may frame rate and integration step change after training? |
//! | [`contacts`] | what happens where the future has a stop, a bounce or another speed? |
//!
//! `analytic` has the known motions, `trial` the small worlds and their runs.

mod analytic;
pub mod contacts;
pub mod horizon;
pub mod integrators;
pub mod observed;
pub mod priors;
pub mod reversal;
pub mod seeds;
pub mod step;
mod trial;
pub mod views;

use crate::experiments::Experiment;

/// All experiments, those without training first.
pub static EXPERIMENTS: [&Experiment; 9] = [
    &integrators::EXPERIMENT,
    &reversal::EXPERIMENT,
    &horizon::EXPERIMENT,
    &views::EXPERIMENT,
    &priors::EXPERIMENT,
    &seeds::EXPERIMENT,
    &observed::EXPERIMENT,
    &step::EXPERIMENT,
    &contacts::EXPERIMENT,
];
