//! `[init]`: the initial Gaussians.

use serde::{Deserialize, Serialize};

use super::error::{ConfigError, check, open_unit, positive};

/// Options of the initial Gaussians.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct InitConfig {
    /// Opacity of an initial Gaussian, 0 to 1. Higher: Gaussians hide those behind them, which then do not learn. Lower: training
    /// is slower.
    pub opacity: f64,
    /// Scale of an initial Gaussian, in mean distances to its three nearest neighbours.
    pub scale: f64,
    /// Initial Gaussians if the data set has no points and photos agree on no more (never more than `density.cap`).
    pub random_points: usize,
    /// Share of `density.cap` that initial Gaussians fill, by positions on which photos agree beside the data set's own points, 0 to 1;
    /// 0: none are looked for beside those. More: steps cost more from the first on. Fewer: growth takes longer to the same quality.
    pub dense_share: f64,
}

impl Default for InitConfig {
    fn default() -> Self {
        Self { opacity: 0.3, scale: 0.8, random_points: 20_000, dense_share: 0.55 }
    }
}

impl InitConfig {
    pub(super) fn validate(&self) -> Result<(), ConfigError> {
        check("init.opacity", self.opacity, open_unit(self.opacity), "between 0 and 1, both excluded")?;
        check("init.scale", self.scale, positive(self.scale), "positive")?;
        check("init.random_points", self.random_points, self.random_points >= 1, "at least 1")?;
        check("init.dense_share", self.dense_share, (0.0..=1.0).contains(&self.dense_share), "from 0 to 1")
    }
}
