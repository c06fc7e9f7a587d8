//! `[init]`: the initial Gaussians.

use super::ranges::{OPEN_UNIT, POSITIVE, SHARE};
use crate::section;

section! {
    /// Options of the initial Gaussians.
    pub struct InitConfig {
        /// A scene that the training goes on from, for `static`: a run, or a file of Gaussians in the data set's world.
        /// Empty: points.
        scene: String = String::new();
        /// Opacity of an initial Gaussian. Higher: Gaussians hide those behind them, which then do not learn. Lower:
        /// training is slower.
        opacity: f64 = 0.3, in OPEN_UNIT;
        /// Scale of an initial Gaussian, in mean distances to its three nearest neighbours.
        scale: f64 = 0.8, in POSITIVE;
        /// Initial Gaussians where the data set has no points and photos agree on no more; never above `density.cap`.
        random_points: usize = 20_000, in 1..;
        /// Share of `density.cap` that initial Gaussians fill, by positions on which photos agree; 0: the data set's
        /// points alone. More: steps cost more from the first on. Fewer: growth takes longer.
        dense_share: f64 = 0.55, in SHARE;
    }
}
