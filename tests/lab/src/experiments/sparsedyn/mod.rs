//! Experiments at the limits of the method.
//!
//! Each has a file; `analytic` has the known motions, `trial` the small worlds and their runs.

mod analytic;
mod contacts;
mod horizon;
mod integrators;
mod observed;
mod priors;
mod reversal;
mod seeds;
mod step;
mod trial;
mod views;

use crate::experiments::Experiment;

/// All experiments, those without training first.
pub static EXPERIMENTS: [Experiment; 9] = [
    Experiment::untrained(
        "integrators",
        "Rotation, shear, saddle and damped oscillator, rolled out with steps from 1/8 to 1/1024: which order has each \
         integrator, is the screw exact for a steady rotation, and which step keeps a radius within 1 % at a given \
         angular speed?",
        integrators::run,
    ),
    Experiment::untrained(
        "reversal",
        "The known motions of `integrators`, rolled out over 1 unit of time and back again: how far from the start \
         does that end, and does the screw return exactly?",
        reversal::run,
    ),
    Experiment::new(
        "horizon",
        "Trained on the first fifth of the recording and rolled out to four times that: PSNR over the horizon with \
         rigid bodies and with the field alone, against a scene that stops where it was last seen; does any Gaussian \
         leave twice the scene's box, is any position not a number?",
        ([6, 2], [1000, 120]),
        horizon::run,
    ),
    Experiment::new(
        "views",
        "2, 3, 5, 9 and 15 training cameras, Gaussians from few to many, colours of degree 0 to 2: where does more of \
         them make held-out cameras worse?",
        ([25, 4], [600, 120]),
        views::run,
    ),
    Experiment::new(
        "priors",
        "True depth of the first frame with noise, with another scale for each photo, with outliers, doubled, and none \
         at all: what does that cost in held-out photos of the first frames?",
        ([9, 5], [1000, 120]),
        priors::run,
    ),
    Experiment::new(
        "seeds",
        "Runs with eight seeds: how far do the PSNR of the future and the number of Gaussians spread?",
        ([8, 3], [1000, 120]),
        seeds::run,
    ),
    Experiment::new(
        "observed",
        "Trained on times up to 0.5, 0.6, 0.7 and 0.75: how well are the photos from 0.75 on predicted, which are \
         farther away the less is seen?",
        ([24, 2], [1000, 120]),
        observed::run,
    ),
    Experiment::new(
        "step",
        "Trained with one step of integration and rolled out with a quarter to four times that; asked for every frame \
         and for every fourth: how far do Gaussians and photos of the future change?",
        ([3, 3], [1000, 120]),
        step::run,
    ),
    Experiment::new(
        "contacts",
        "A box that slides as long as it is seen, and then, at 0.85, stops at once, bounces back or goes on at half \
         its speed: how far off are the predicted photos after that?",
        ([1, 1], [1000, 120]),
        contacts::run,
    ),
];
