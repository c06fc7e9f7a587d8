//! A scene with its photos, and how it is drawn.

use burn::tensor::{Device, Tensor};
use gs_burn::{Camera, Extras, Gaussians, RenderOptions, Rendering, render, render_with};
use gs_datasets::{CameraPose, Scene, View};
use gs_models::DynamicScene;

use gs_train::config::RenderConfig;
use gs_train::fit::facts::SceneFacts;
use gs_train::run::measured::Measured;

/// How pictures of a scene are drawn.
#[derive(Debug, Clone)]
pub struct SceneRenderer {
    /// Values fixed by its data set.
    pub facts: SceneFacts,
    /// Options of its renderer.
    pub render: RenderConfig,
    /// The compute device, without autodiff.
    pub device: Device,
}

/// A scene with the photos that it is held against.
#[derive(Clone, Copy)]
pub struct PredictedScene<'a> {
    /// How it is drawn.
    pub renderer: &'a SceneRenderer,
    /// The scene at any time.
    pub scene: &'a dyn DynamicScene,
    /// The photos; the scene's origin is subtracted from their cameras.
    pub photos: &'a Scene,
    /// A measurement of the scene on a split of the photos, whose scores are not taken again.
    pub measured: Option<&'a Measured>,
}

impl SceneRenderer {
    /// The rendering of Gaussians by a camera with the scene's origin subtracted, `[H, W, 3]` from 0 to 1.
    pub fn image(&self, gaussians: &Gaussians, pose: &CameraPose) -> Tensor<3> {
        let camera = self.camera(pose);
        render(gaussians, &camera, &self.options(gaussians)).color.clamp(0.0, 1.0)
    }

    /// The same with `features` `[N, F]` of the Gaussians, see [`Extras`].
    pub fn with_features(&self, gaussians: &Gaussians, pose: &CameraPose, features: Tensor<2>) -> Rendering {
        let camera = self.camera(pose);
        let extras = Extras { features: Some(features), ..Extras::default() };
        render_with(gaussians, &camera, &self.options(gaussians), extras)
    }

    fn options(&self, gaussians: &Gaussians) -> RenderOptions {
        self.facts.render_options(&self.render, gaussians.sh_degree())
    }

    fn camera(&self, pose: &CameraPose) -> Camera {
        Camera::from_c2w(pose.c2w, pose.intrinsics, pose.width, pose.height, &self.device)
    }
}

/// The camera of a view, named by its id or else by the view.
pub fn pose_of(view: &View) -> CameraPose {
    CameraPose {
        name: view.camera_id.clone().unwrap_or_else(|| view.name.clone()),
        c2w: view.c2w,
        intrinsics: view.intrinsics,
        width: view.width,
        height: view.height,
        time: view.time,
    }
}

/// A camera whose image has at least `side` pixels along its shorter side, by a whole factor.
pub fn enlarged(pose: &CameraPose, side: usize) -> CameraPose {
    let factor = side.div_ceil(pose.width.min(pose.height).max(1)).max(1);
    let scale = factor as f64;
    CameraPose {
        intrinsics: pose.intrinsics.scaled(scale, scale),
        width: pose.width * factor,
        height: pose.height * factor,
        ..pose.clone()
    }
}
