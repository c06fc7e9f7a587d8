//! The loss of one snippet: every view rendered at its time, compared, and averaged (Algorithm 1 with all terms of the
//! paper).

use burn::tensor::{Tensor, assert_shape};
use gs_burn::{Camera, Extras, Gaussians, RenderOptions, Rendering, render_with};

use super::activate::{ScaleLimits, activate_within};
use super::losses::{LossConfig, depth_loss, image_velocity, mean_speed, photometric, velocity_weights};
use super::motion::PolynomialMotion;

/// A photo to be compared with.
#[derive(Debug, Clone)]
pub struct TargetView {
    /// Pose, intrinsics and size.
    pub camera: Camera,
    /// 0 to 1 over the input frames, beyond 1 for future ones.
    pub time: f64,
    /// `[H, W, 3]`, 0 to 1.
    pub photo: Tensor<3>,
    /// Projected LiDAR of the frame, `[H, W, 1]`, camera z in metres, 0 where there is none.
    pub depth: Option<Tensor<3>>,
}

/// The values that the Gaussians of a snippet share and no network changes.
#[derive(Debug, Clone)]
pub struct SnippetFrame {
    /// `[N]`, the own time of each row.
    pub times: Tensor<1>,
    /// The last rows that are sky or far points; their speed is not in the mean.
    pub far: usize,
    /// Clamps of the scales.
    pub limits: ScaleLimits,
    /// The velocity's polynomial.
    pub motion: PolynomialMotion,
    /// First velocities `[N, 3 (l + 1)]`, metres per window, which the loss of speed keeps to; `None`: rest, as in the
    /// paper.
    pub start: Option<Tensor<2>>,
    /// Time between two frames, in windows: 0.1 for 11 frames.
    pub frame: f64,
}

impl SnippetFrame {
    /// The Gaussians of `raw` `[N, 14]` moved by `velocity` `[N, 3 (l + 1)]` to the time `t`.
    pub fn at(&self, raw: Tensor<2>, velocity: Tensor<2>, t: f64) -> Gaussians {
        let gaussians = activate_within(raw, &self.limits);
        let moved = gaussians.means.val() + self.motion.displacement(velocity, self.times.clone(), t);
        let Gaussians { quats, log_scales, opacity_logits, sh, .. } = gaussians;
        Gaussians::from_tensors(moved, quats.val(), log_scales.val(), opacity_logits.val(), sh.val())
    }

    /// The rendering of one view, with depth, and with the image velocity `[H, W, 2]` (pixels per frame) as features if
    /// `velocities`.
    pub fn render(&self, raw: Tensor<2>, velocity: Tensor<2>, view: (&Camera, f64), velocities: bool) -> Rendering {
        let (camera, t) = view;
        let gaussians = self.at(raw, velocity.clone(), t);
        let features = velocities.then(|| {
            let speed = self.motion.velocity(velocity.inner(), t);
            image_velocity(gaussians.means.val(), speed, camera, self.frame)
        });
        let options = RenderOptions { depth: true, sh_degree: 0, ..RenderOptions::default() };
        render_with(&gaussians, camera, &options, Extras { features, ..Extras::default() })
    }

    /// The loss over `views`: the mean over the views, and the mean speed once, `[1]`.
    ///
    /// # Panics
    /// Without views, or when shapes disagree.
    pub fn loss(&self, raw: Tensor<2>, velocity: Tensor<2>, views: &[TargetView], config: &LossConfig) -> Tensor<1> {
        let of_view = |view| self.term(raw.clone(), velocity.clone(), (views, view), config);
        (0..views.len()).map(of_view).reduce(|a, b| a + b).expect("a snippet is compared with at least one view")
    }

    /// The part of view `view` in [`Self::loss`], `[1]`; the first one has the mean speed of the change from the first
    /// velocities.
    ///
    /// # Panics
    /// When there is no such view, or shapes disagree.
    pub fn term(
        &self,
        raw: Tensor<2>,
        velocity: Tensor<2>,
        (views, view): (&[TargetView], usize),
        config: &LossConfig,
    ) -> Tensor<1> {
        let rows = raw.dims()[0];
        assert_shape!(velocity, [rows, self.motion.columns()]);
        let own = self.view_loss(raw, velocity.clone(), &views[view], config) / views.len() as f64;
        if view > 0 {
            return own;
        }
        let change = match &self.start {
            Some(start) => velocity - start.clone(),
            None => velocity,
        };
        own + mean_speed(change, rows - self.far) * config.velocity
    }

    fn view_loss(&self, raw: Tensor<2>, velocity: Tensor<2>, view: &TargetView, config: &LossConfig) -> Tensor<1> {
        let reweighted = config.reweight_clip > 0.0;
        let rendering = self.render(raw, velocity, (&view.camera, view.time), reweighted);
        let weights = rendering.features.clone().map(|rendered| velocity_weights(rendered, config.reweight_clip));
        let loss = photometric(rendering.color.clone(), view.photo.clone(), weights, config.dssim);
        match &view.depth {
            Some(depth) if config.depth > 0.0 => loss + depth_loss(&rendering, depth.clone()) * config.depth,
            _ => loss,
        }
    }
}
