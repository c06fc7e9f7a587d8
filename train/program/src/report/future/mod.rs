//! The future of a run in pictures and figures: what is predicted, how far it is right, and how sure it is.
//!
//! | file | idea |
//! |---|---|
//! | [`horizon`] | PSNR over time, and that of the last state held |
//! | [`strip`] | predicted frames above the photos of the same times |
//! | [`canvas`], [`trajectories`] | paths of Gaussians over an image |
//! | [`motion`] | velocities and angular velocities, and maps of any number of a Gaussian |
//! | [`spread`] | how far the members of an ensemble are apart |
//! | [`calibration`] | predicted spread against true error |
//! | [`section`] | all of it in the report |

pub mod calibration;
pub mod canvas;
pub mod horizon;
pub mod motion;
pub mod renderer;
pub mod section;
pub mod spread;
pub mod strip;
pub mod trajectories;

pub use horizon::Horizon;
pub use renderer::{PredictedScene, SceneRenderer, pose_of};
pub use section::{Shown, add_to_report};

/// Share of the seen time by which two times of one frame differ at most: they are rounded in files.
pub const ONE_TIME: f64 = 1e-6;
