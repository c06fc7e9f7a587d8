//! The loss of one snippet: every view rendered at its time, compared, and averaged (Algorithm 1 with all terms of the
//! paper).

use burn::tensor::{Tensor, TensorData, assert_shape};
use gs_burn::{Camera, Extras, Gaussians, RenderOptions, Rendering, render_with};

use super::activate::{ScaleLimits, activate_within};
use super::losses::{
    LossConfig, depth_loss, image_velocity, mean_speed, photometric, velocity_weights, weighted_speed,
};
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
    /// The motion that the sweeps themselves show; `None`: velocities are the network's alone, as in the paper.
    pub shown: Option<ShownMotion>,
    /// Time between two frames, in windows: 0.1 for 11 frames.
    pub frame: f64,
}

/// The motion that the sweeps of a snippet show of its rows.
#[derive(Debug, Clone)]
pub struct ShownMotion {
    /// `[N, 3 (l + 1)]`, metres per window; zero where nothing is shown.
    pub velocity: Tensor<2>,
    /// `[N, 1]`, 1 for the rows whose motion or rest is shown and 0 for those whose velocity is the network's.
    pub is_known: Tensor<2>,
    /// `[N, 1]`, weights of the rows in the difference of a network's velocities from these.
    pub weights: Tensor<2>,
}

impl ShownMotion {
    /// The velocities of a network where the sweeps show nothing, zero elsewhere.
    fn free(&self, predicted: Tensor<2>) -> Tensor<2> {
        predicted * (self.is_known.clone().neg() + 1.0)
    }
}

impl SnippetFrame {
    /// The velocities of the rows by those of a network, `[N, 3 (l + 1)]` both: what the sweeps show counts before it.
    pub fn velocity(&self, predicted: Tensor<2>) -> Tensor<2> {
        match &self.shown {
            Some(shown) => shown.free(predicted) + shown.velocity.clone() * shown.is_known.clone(),
            None => predicted,
        }
    }

    /// The same frame for velocities that were found by sweeps and network, `[N, 3 (l + 1)]`: all of them may change,
    /// and the loss keeps to them.
    pub fn around(&self, velocity: Tensor<2>) -> Self {
        let shown = self.shown.as_ref().map(|shown| {
            let near = velocity.dims()[0] - self.far;
            let weights: Vec<f32> = (0..velocity.dims()[0]).map(|row| if row < near { 1.0 } else { 0.0 }).collect();
            let weights = TensorData::new(weights, shown.is_known.dims());
            let weights = Tensor::from_data(weights, (&velocity.device(), velocity.dtype()));
            ShownMotion { velocity, is_known: shown.is_known.zeros_like(), weights }
        });
        Self { shown, ..self.clone() }
    }

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

    /// The loss over `views`: the mean over the views, and the terms of the velocities once, `[1]`; `velocity` is a
    /// network's.
    ///
    /// # Panics
    /// Without views, or when shapes disagree.
    pub fn loss(&self, raw: Tensor<2>, velocity: Tensor<2>, views: &[TargetView], config: &LossConfig) -> Tensor<1> {
        let of_view = |view| self.term(raw.clone(), velocity.clone(), (views, view), config);
        (0..views.len()).map(of_view).reduce(|a, b| a + b).expect("a snippet is compared with at least one view")
    }

    /// The part of view `view` in [`Self::loss`], `[1]`; the first one has the terms of the velocities.
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
        let moved = self.velocity(velocity.clone());
        let own = self.view_loss(raw, moved, &views[view], config) / views.len() as f64;
        match view {
            0 => own + self.velocity_loss(velocity, config),
            _ => own,
        }
    }

    /// The mean speed of the rows that are not far where the sweeps show none, and the difference from what they show,
    /// `[1]`.
    fn velocity_loss(&self, velocity: Tensor<2>, config: &LossConfig) -> Tensor<1> {
        let near = velocity.dims()[0] - self.far;
        let Some(shown) = &self.shown else { return mean_speed(velocity, near) * config.velocity };
        let difference = weighted_speed(velocity.clone() - shown.velocity.clone(), shown.weights.clone());
        mean_speed(shown.free(velocity), near) * config.velocity + difference * config.shown
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
