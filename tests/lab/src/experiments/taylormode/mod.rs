//! Experiments at the limits of the method.
//!
//! | file | question |
//! |---|---|
//! | [`direction`] | does blur determine the direction of motion? |
//! | [`exposure`] | can exposure and speed be told apart? |
//! | [`absorb`] | does the blur model absorb the scene's own blur? |
//! | [`samples`] | how many instants does an exposure need? |
//! | [`divergence`] | how does a Taylor path diverge outside its window? |
//! | [`depth`] | what does a wrong depth prior cost? |
//! | [`masks`] | what do masks cost that are too wide or too narrow? |
//! | [`speed`] | how much motion per exposure can be deblurred? |
//! | [`thrown`] | does early training displace Gaussians far? |
//! | [`opacity`] | what do opacity resets cost? |
//! | [`sensitivity`] | what do the heuristics cost where they are wrong by a factor of two? |

pub mod absorb;
pub mod depth;
pub mod direction;
pub mod divergence;
pub mod exposure;
pub mod masks;
pub mod opacity;
pub mod samples;
pub mod sensitivity;
pub mod speed;
mod surface;
pub mod thrown;
mod trial;

pub use trial::Trial;

use crate::experiments::Experiment;

/// All experiments, the cheapest kinds first.
pub static EXPERIMENTS: [&Experiment; 11] = [
    &divergence::EXPERIMENT,
    &thrown::EXPERIMENT,
    &samples::EXPERIMENT,
    &direction::EXPERIMENT,
    &exposure::EXPERIMENT,
    &absorb::EXPERIMENT,
    &depth::EXPERIMENT,
    &masks::EXPERIMENT,
    &speed::EXPERIMENT,
    &opacity::EXPERIMENT,
    &sensitivity::EXPERIMENT,
];
