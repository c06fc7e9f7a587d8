//! TaylorMoDe-GS: sharp moving scenes from motion-blurred multi-view video.
//!
//! | paper | here |
//! |---|---|
//! | 3.2 Taylor motion and velocity (Eq. 2, 3), velocity splatting (Eq. 4), remainder (Eq. 5) | `gs_models::taylormode`, [`velocity`]; the module tree: [`model`] |
//! | 3.3 blur synthesis (Eq. 6 to 12) | [`forward`]: `warped`; the exact formation: `integrated`, with [`blur`] |
//! | 3.4 losses (Eq. 13 to 19), gradient decoupling | [`forward`], weights in [`config`] |
//! | beyond the paper: all Gaussians of a body are also updated together | [`common_motion`] |
//! | beyond the paper: no more motion than a scene needs | [`select`], beside the bodies of [`carriers`], judged by [`likelihood`]; [`score`] |
//! | measuring on sharp ground truth | [`figures`] |

pub mod begin;
pub mod bench;
pub mod blur;
mod bodies;
pub mod carriers;
pub mod common_motion;
pub mod config;
pub mod cues;
pub mod curriculum;
pub mod extra;
pub mod figures;
pub mod forward;
pub mod initial_paths;
pub mod initial_points;
pub mod likelihood;
mod method;
pub mod model;
mod scene;
pub mod score;
pub mod select;
pub mod update;
pub mod velocity;

pub use config::Sections;
pub use cues::Cues;
pub use extra::PhotoPriors;
pub use model::Taylormode;

/// A whole configuration of the pipeline.
pub type Config = gs_train::config::FitConfig<Sections>;

/// One step of the pipeline.
pub type Step<'a> = gs_train::fit::method::Step<'a, Taylormode>;
