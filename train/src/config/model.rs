//! `[model]` and `[render]`: the numbers of a Gaussian, and the renderer's options.

use gs_burn::RenderOptions;

use super::error::{ConfigError, check};
use super::ranges::{NOT_NEGATIVE, Only, positive};
use crate::section;

section! {
    /// Numbers that a Gaussian stores.
    #[derive(Eq)]
    pub struct ModelConfig {
        /// Highest degree of the view-dependent colour, 0 to 3; 48 numbers per Gaussian at 3, 3 at 0.
        sh_degree: usize = 3, in Only("0, 1, 2 or 3", |degree| *degree <= 3);
        /// Steps from one degree to the next; shorter in a short run.
        sh_interval: usize = 250, in 1..;
    }
}

section! {
    /// Options of the renderer.
    pub struct RenderConfig {
        /// Near plane, scene units; 0: by the data set.
        near: f64 = 0.0, in Only("positive, or 0: by the data set", |near| *near == 0.0 || positive(*near));
        /// Far plane, scene units.
        far: f64 = RenderOptions::default().far;
        /// Variance added to every projected Gaussian, square pixels.
        eps2d: f64 = RenderOptions::default().eps2d, in NOT_NEGATIVE;
        /// Whether the brightening by `eps2d` is compensated (Mip-Splatting): less aliasing at other focal lengths.
        antialiased: bool = RenderOptions::default().antialiased;
    }
    also check_planes;
}

fn check_planes(render: &RenderConfig) -> Result<(), ConfigError> {
    check("render.far", render.far, render.far > render.near, "larger than render.near")
}
