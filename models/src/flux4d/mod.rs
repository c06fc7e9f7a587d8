//! Flux4D: moving Gaussians of a driving log in seconds, by a network that learns without labels.
//!
//! The paper is "Flux4D: Flow-based Unsupervised 4D Reconstruction"; sections and equations are those of its
//! supplement.
//!
//! | Paper | Here |
//! |---|---|
//! | A.2, initialization | [`lift`](mod@lift), of the raw [`channels`]; neighbours by [`nearest`] |
//! | A.2, sky; main paper, random points in a sphere | [`far`] |
//! | A.2, rendering: activations and the clamp of scales | [`activate`](mod@activate) |
//! | A.2, Fig. A1: the sparse 3D UNet | [`unet`] |
//! | A.1, Eq. 2: polynomial motion | [`motion`] |
//! | A.1, Eq. 1: velocity reweighting; main paper, Eq. 3 to 5 | [`losses`], with [`similarity`] |
//! | Algorithm 1: the loss of a whole snippet | [`snippet`] |
//! | A.2, Algorithm 2: iterative refinement | [`refinement`] |
//! | Algorithm 3: moving objects; D.5, edits | [`actors`] |
//! | D.1: scene flow | [`flow_metrics`], and the baseline [`fast_nsf`] |
//! | beyond the paper: velocities that the sweeps show | [`alignment`] |
//! | beyond the paper: fewer points where they add nothing | [`merge`] |
//! | the result | [`scene`] |

pub mod activate;
pub mod actors;
pub mod alignment;
pub mod channels;
pub mod error;
pub mod far;
pub mod fast_nsf;
pub mod flow_metrics;
pub mod lift;
pub mod losses;
pub mod merge;
pub mod motion;
pub mod nearest;
pub mod refinement;
pub mod scene;
pub mod similarity;
pub mod snippet;
pub mod unet;

pub use activate::{ScaleLimits, activate, activate_within};
pub use error::FluxError;
pub use far::{BoxLength, FarConfig};
pub use lift::{LiftConfig, LiftInput, Lifted, LiftedRows, Rotations, lift, lift_rows};
pub use losses::LossConfig;
pub use motion::PolynomialMotion;
pub use refinement::{Feedback, Network, Objective, Refined, Refinement, RefinementConfig};
pub use scene::FluxScene;
pub use snippet::{ShownMotion, SnippetFrame, TargetView};
