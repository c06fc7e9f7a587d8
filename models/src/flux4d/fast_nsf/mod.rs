//! Scene flow by optimisation alone: a network per pair of sweeps, fitted to the distance transform of the second (in
//! the manner of Fast Neural Scene Flow, Li et al. 2023). The baseline that a feed-forward model is compared with.
//!
//! | part | file |
//! |---|---|
//! | distance to the nearest point on a grid | [`distance`] |
//! | the fit | [`fit`] |

pub mod distance;
pub mod fit;

pub use distance::DistanceGrid;
pub use fit::{FastNsfConfig, FlowFit, fit_flow};
