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

use crate::experiments::Experiment;

/// All experiments, the cheapest kinds first.
pub static EXPERIMENTS: [Experiment; 11] = [
    Experiment::untrained(
        "divergence",
        "Sinusoid, circle, flight and bounce, fitted with paths of order 0 to 5, with and without the 3D remainder: \
         how far off are they inside the window, how far beyond it, and does the remainder vanish faster than the last \
         power?",
        divergence::run,
    ),
    Experiment::new(
        "thrown",
        "Scenes 1e-2 to 1e2 times as large, three seeds: does a step ever move a Gaussian far, anywhere in the \
         recording, and is the deformation nothing before the first?",
        ([15, 2], [60, 30]),
        thrown::run,
    ),
    Experiment::new(
        "samples",
        "An exposure formed from 3 to 33 instants against one formed from 129: how wrong is it, by the pixels that \
         things move from one instant to the next?",
        ([1, 1], [400, 40]),
        samples::run,
    ),
    Experiment::new(
        "direction",
        "Paths begin with minus the velocity that the masks say: from how many frames on does training turn them \
         round?",
        ([15, 3], [1000, 100]),
        direction::run,
    ),
    Experiment::new(
        "exposure",
        "The exposure begins at 0.25 to 4 times the truth: is it found, and is its product with speed?",
        ([5, 2], [1600, 60]),
        exposure::run,
    ),
    Experiment::new(
        "absorb",
        "Sharp PSNR, and that of the training photos as they are formed, along training by blur model: does forming \
         the photos well make the scene sharp? And on photos that were sharp to begin with, does the model leave them \
         unchanged?",
        ([6, 6], [960, 60]),
        absorb::run,
    ),
    Experiment::new(
        "depth",
        "True depth, corrupted by a scale and a shift per photo in depth or in disparity, and by 20 % outliers: what \
         does it cost fitted per photo, fitted once for all photos, by correlation alone, and believed?",
        ([19, 5], [480, 40]),
        depth::run,
    ),
    Experiment::new(
        "masks",
        "True masks of what moves, eroded and dilated by up to 6 pixels of 96: what does it cost?",
        ([7, 3], [560, 40]),
        masks::run,
    ),
    Experiment::new(
        "speed",
        "0 to 60 pixels of motion per exposure: what is left of the moving parts, with the exact formation and without \
         a blur model?",
        ([12, 4], [600, 40]),
        speed::run,
    ),
    Experiment::new(
        "opacity",
        "Opacities reset, decaying or left alone under classic density control, in a blurry moving scene, a sharp \
         moving one and a static one: what does each cost during training and at the end?",
        ([9, 9], [900, 180]),
        opacity::run,
    ),
    Experiment::new(
        "sensitivity",
        "Each heuristic of [cues] halved and doubled, photos alone: how many dB does it move?",
        ([38, 38], [600, 60]),
        sensitivity::run,
    )
    .on_request(),
];
