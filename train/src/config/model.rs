//! `[model]` and `[render]`: the numbers of a Gaussian, and the renderer's options.

use gs_burn::RenderOptions;
use serde::{Deserialize, Serialize};

use super::error::{ConfigError, check, positive};

/// Numbers that a Gaussian stores.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ModelConfig {
    /// Highest degree of the view-dependent colour, 0 to 3; 48 numbers per Gaussian at 3, 3 at 0.
    pub sh_degree: usize,
    /// Steps from one degree to the next; shorter in a short run.
    pub sh_interval: usize,
}

impl Default for ModelConfig {
    fn default() -> Self {
        Self { sh_degree: 3, sh_interval: 1000 }
    }
}

/// Options of the renderer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RenderConfig {
    /// Near plane: Gaussians nearer than this are culled, scene units; 0: from the data set (see `SceneFacts`).
    pub near: f64,
    /// Far plane: Gaussians farther than this are culled, scene units.
    pub far: f64,
    /// Variance added to every projected Gaussian, square pixels.
    pub eps2d: f64,
    /// Compensate the brightening by `eps2d` (Mip-Splatting): less aliasing at other focal lengths. The scene must then be rendered
    /// with it too.
    pub antialiased: bool,
}

impl Default for RenderConfig {
    fn default() -> Self {
        let options = RenderOptions::default();
        Self { near: 0.0, far: options.far, eps2d: options.eps2d, antialiased: options.antialiased }
    }
}

impl ModelConfig {
    pub(super) fn validate(&self) -> Result<(), ConfigError> {
        check("model.sh_degree", self.sh_degree, self.sh_degree <= 3, "0, 1, 2 or 3")?;
        check("model.sh_interval", self.sh_interval, self.sh_interval >= 1, "at least 1")
    }
}

impl RenderConfig {
    pub(super) fn validate(&self) -> Result<(), ConfigError> {
        let near = positive(self.near) || self.near == 0.0;
        check("render.near", self.near, near, "positive, or 0: by the data set")?;
        check("render.far", self.far, self.far > self.near, "larger than render.near")?;
        check("render.eps2d", self.eps2d, self.eps2d.is_finite() && self.eps2d >= 0.0, "0 or more")
    }
}
