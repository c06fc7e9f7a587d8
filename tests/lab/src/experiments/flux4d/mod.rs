//! Experiments at the limits of the method, on synthetic streets with exact truth.
//!
//! `along` has those that apply a network at the values of a key or a fault, the others have a file each; `trial` has
//! the streets. All but the weight of the mean speed apply the network that ships with the program, which was trained
//! on other streets.

mod along;
mod baseline;
mod bins;
mod cost;
mod holes;
mod occlusion;
mod trial;

use crate::experiments::{Experiment, experiments};

/// All experiments, that with trainings last.
pub static EXPERIMENTS: [Experiment; 10] = experiments![
    /// A network trained on 32 beams and images of 320 pixels, applied to a LiDAR of 4 to 128 beams and to images of
    /// other sizes: what breaks first?
    "beams": along::beams;
    /// Camera poses with noise, and images that were taken later than their times say: what does that cost in images,
    /// and does motion, which is read off the LiDAR, stay as it was?
    "calibration": along::calibration;
    /// A covered lens, a sweep that is missing, a LiDAR of one beam: is what can be used used, and is nothing made of
    /// nothing?
    "holes": holes::run;
    /// Cars that drive, brake and turn, each followed over the frames between the inputs by velocities of degree 0 to
    /// 3, before any training (2 and 3 then equal 1): does an acceleration pay?
    "degree": along::degree;
    /// A car drives beside the ego vehicle, and a bus comes between them from the second input sweep to the last but
    /// one: does the car keep its motion where it is seen?
    "occlusion": occlusion::run;
    /// The shipped network, trained with two refinements, applied with none to five: what does each add to the frames
    /// between the inputs, and how long does it take?
    "passes": along::passes;
    /// PSNR of the frames between the inputs by distance, and of the sky, which has no LiDAR point: does far mean
    /// wrong?
    "bins": bins::run;
    /// Scene flow of the same points by the shipped network, and by fitting a network to each pair of sweeps (FastNSF):
    /// which is nearer to the truth, and how long does a sweep take?
    "baseline": baseline::run;
    /// Seconds of reading and lifting, kernel maps, passes and one image over the number of LiDAR points: do they grow
    /// more than in proportion, and from which number on does an image gain nothing?
    "cost": cost::run;
    /// The weight of the mean speed over five decades, trained on one street without velocities of the sweeps: does
    /// what rests come to rest, and at which weight does motion vanish?
    "weight": along::weight, [5, 2] of [60, 5];
];
