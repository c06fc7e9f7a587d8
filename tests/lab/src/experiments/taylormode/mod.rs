//! Experiments at the limits of the method.
//!
//! Each has a file; `trial` has the runs on small worlds, `surface` the true velocity below a Gaussian.

mod absorb;
mod depth;
mod direction;
mod divergence;
mod exposure;
mod masks;
mod opacity;
mod samples;
mod sensitivity;
mod speed;
mod surface;
mod thrown;
mod trial;

use crate::experiments::{Experiment, experiments};

/// All experiments, the cheapest kinds first.
pub static EXPERIMENTS: [Experiment; 11] = experiments![
    /// Sinusoid, circle, flight and bounce, fitted with paths of order 0 to 5, with and without the 3D remainder: how
    /// far off are they inside the window, how far beyond it, and does the remainder vanish faster than the last power?
    "divergence": divergence::run;
    /// Scenes 1e-2 to 1e2 times as large, three seeds: does a step ever move a Gaussian far, anywhere in the recording,
    /// and is the deformation nothing before the first?
    "thrown": thrown::run, [15, 2] of [60, 30];
    /// An exposure formed from 3 to 33 instants against one formed from 129: how wrong is it, by the pixels that things
    /// move from one instant to the next?
    "samples": samples::run, [1, 1] of [400, 40];
    /// Paths begin with minus the velocity that the masks say: from how many frames on does training turn them round?
    "direction": direction::run, [15, 3] of [1000, 100];
    /// The exposure begins at 0.25 to 4 times the truth: is it found, and is its product with speed?
    "exposure": exposure::run, [5, 2] of [1600, 60];
    /// Sharp PSNR, and that of the training photos as they are formed, along training by blur model: does forming the
    /// photos well make the scene sharp? And on photos that were sharp to begin with, does the model leave them
    /// unchanged?
    "absorb": absorb::run, [6, 6] of [960, 400];
    /// True depth, corrupted by a scale and a shift per photo in depth or in disparity, and by 20 % outliers: what does
    /// it cost fitted per photo, fitted once for all photos, by correlation alone, and believed?
    "depth": depth::run, [19, 5] of [480, 40];
    /// True masks of what moves, eroded and dilated by up to 6 pixels of 96: what does it cost?
    "masks": masks::run, [7, 3] of [560, 40];
    /// 0 to 60 pixels of motion per exposure: what is left of the moving parts, with the exact formation and without a
    /// blur model?
    "speed": speed::run, [12, 4] of [600, 40];
    /// Opacities reset, decaying or left alone under classic density control, in a blurry moving scene, a sharp moving
    /// one and a static one: what does each cost during training and at the end?
    "opacity": opacity::run, [9, 9] of [900, 180];
    /// Each heuristic of [cues] halved and doubled, photos alone: how many dB does it move?
    "sensitivity": sensitivity::run, [38, 38] of [600, 60], on_request;
];
