//! SparseDynGS: physical motion of a scene from videos of 3 to 5 cameras, and its future.
//!
//! | paper | here |
//! |---|---|
//! | 3.1 dynamics field, Runge-Kutta step, rollout (Eq. 3, 4, 9) | `gs_models::sparsedyn`; the module tree: [`model`] |
//! | 3.1 Gaussians of the first frame from a feed-forward reconstruction | [`begin`], `sources` |
//! | 3.2 regularised refinement (Eq. 5 to 7) | [`forward`]: warm-up |
//! | 3.3 progressive physics learning (Eq. 8 to 10) | [`order`] (the frames of a step), [`forward`] (their weights), [`timetable`] (shown) |
//! | 4.1 the baselines, from the same prior | [`motion`] |
//! | beyond the paper: recordings in any unit of time | [`clock`] |
//! | beyond the paper: only what moves is integrated | [`evidence`] |
//! | beyond the paper: rigid bodies and their laws | [`discover`], `laws`, `choice` |
//! | when Gaussians are added and removed | [`count`] |
//! | measuring against the truth of synthetic worlds | [`figures`] |
//! | beyond the paper: parts, an ensemble and other steps for the future | [`future`] |

pub mod begin;
mod choice;
pub mod clock;
pub mod config;
pub mod count;
pub mod cues;
pub mod discover;
pub mod evidence;
pub mod extra;
pub mod figures;
pub mod forward;
pub mod future;
mod groups;
mod judges;
mod laws;
mod method;
pub mod model;
pub mod motion;
pub mod order;
mod poses;
pub mod scene;
mod sources;
pub mod timetable;
pub mod update;

pub use config::Sections;
pub use cues::Cues;
pub use extra::PhotoCues;
pub use model::Sparsedyn;

/// A whole configuration of the pipeline.
pub type Config = gs_train::config::FitConfig<Sections>;

/// One step of the pipeline.
pub type Step<'a> = gs_train::fit::method::Step<'a, Sparsedyn>;

/// The pipeline's name.
pub const NAME: &str = "sparsedyn";

/// The keys that decide how large a model is, with values to try: half the width, a third of the bands and a count that
/// few objects exceed, each with and without, in eight runs.
pub const SIZES: [(&str, &[&str]); 3] =
    [("dynamics.width", &["32", "64"]), ("dynamics.bands", &["1", "3"]), ("density.cap", &["1500", "20000"])];
