//! Experiments at the limits of the method.
//!
//! Each has a file; `analytic` has the known motions, `trial` the small worlds and their runs.

mod analytic;
mod contacts;
mod horizon;
mod integrators;
mod laws;
mod observed;
mod priors;
mod reversal;
mod seeds;
mod step;
mod trial;
mod views;

use crate::experiments::{Experiment, experiments};

/// All experiments, those without training first.
pub static EXPERIMENTS: [Experiment; 10] = experiments![
    /// Rotation, shear, saddle and damped oscillator, rolled out with steps from 1/8 to 1/1024: which order has each
    /// integrator, is the screw exact for a steady rotation, and which step keeps a radius within 1 % at a given
    /// angular speed?
    "integrators": integrators::run;
    /// The known motions of `integrators`, rolled out over 1 unit of time and back again: how far from the start does
    /// that end, and does the screw return exactly?
    "reversal": reversal::run;
    /// Trained on the first fifth of the recording and rolled out to four times that: PSNR over the horizon with rigid
    /// bodies and with the field alone, against a scene that stops where it was last seen; does any Gaussian leave
    /// twice the scene's box, is any position not a number?
    "horizon": horizon::run, [6, 2] of [1000, 240];
    /// 2, 3, 5, 9 and 15 training cameras, Gaussians from few to many, colours of degree 0 to 2: where does more of
    /// them make held-out cameras worse?
    "views": views::run, [25, 4] of [600, 120];
    /// True depth of the first frame with noise, with another scale for each photo, with outliers, doubled, and none at
    /// all: what does that cost in held-out photos of the first frames?
    "priors": priors::run, [9, 5] of [1000, 360];
    /// Runs with eight seeds: how far do the PSNR of the future and the number of Gaussians spread?
    "seeds": seeds::run, [8, 3] of [1000, 120];
    /// Trained on times up to 0.5, 0.6, 0.7 and 0.75: how well are the photos from 0.75 on predicted, which are farther
    /// away the less is seen?
    "observed": observed::run, [24, 2] of [1000, 240];
    /// Trained with one step of integration and rolled out with a quarter to four times that; asked for every frame and
    /// for every fourth: how far do Gaussians and photos of the future change?
    "step": step::run, [3, 3] of [1000, 120];
    /// A box that slides as long as it is seen, and then, at 0.85, stops at once, bounces back or goes on at half its
    /// speed: how far off are the predicted photos after that?
    "contacts": contacts::run, [1, 1] of [1000, 120];
    /// Random worlds of one to three bodies, photos of five cameras alone: of which kind is the law that each body
    /// gets, and what does the future gain over the last state seen?
    "laws": laws::run, [24, 2] of [6000, 240], on_request;
];
