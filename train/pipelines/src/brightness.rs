//! `brightness`: 3D Gaussian Splatting with a learned brightness for each photo, for cameras with automatic exposure.
//!
//! The rendering of photo `i` is multiplied by `exp(g_i - mean(g))`. The mean is subtracted because a brighter scene
//! under darker photos looks the same. This is also the example of docs/extend.md: a pipeline in one file and one line.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use gs_burn::adam::{Adam, AdamRate};
use gs_burn::{Extras, Gaussians, NamedGradients, render_with};
use gs_datasets::{Scene, View};

use gs_train::config::{Config, FitConfig, NOT_NEGATIVE, Section};
use gs_train::fit::figure::{Figure, Figures};
use gs_train::fit::initialise::InitialGaussians;
use gs_train::fit::intake::Intake;
use gs_train::fit::losses::photometric;
use gs_train::fit::method::{Drawn, Forward, Method, Step, begin_static};
use gs_train::fit::parameters::to_host;
use gs_train::fit::photos::{Extra, Photo};
use gs_train::fit::saved::Saved;
use gs_train::fit::told::Told;
use gs_train::section;

section! {
    /// `[brightness]`.
    pub struct BrightnessConfig {
        /// Learning rate of the logarithm of each photo's brightness. Larger: it follows the noise of single steps.
        /// Smaller: it converges late.
        lr: f64 = 5e-3, in NOT_NEGATIVE;
    }
}

section! {
    /// The sections that the pipeline adds.
    pub struct Sections {
        /// Options of the learned brightness.
        brightness: BrightnessConfig;
    }
}

impl Section for Sections {}

/// Index of a training photo.
#[derive(Debug, Clone, Copy)]
pub struct Index(usize);

impl Extra for Index {}

/// The brightness of each training photo.
#[derive(Module, Debug)]
pub struct Brightness {
    /// `[photos, 1]`, natural logarithms.
    pub gains: Param<Tensor<2>>,
}

impl Brightness {
    fn of(photos: usize, device: &Device) -> Self {
        Self { gains: Param::from_tensor(Tensor::zeros([photos, 1], device)) }
    }

    /// The factor of each photo's rendering, `[photos, 1]`.
    pub fn factors(&self) -> Tensor<2> {
        let gains = self.gains.val();
        (gains.clone() - gains.mean().reshape([1, 1])).exp()
    }
}

impl Method for Brightness {
    const NAME: &'static str = "brightness";
    type Config = Sections;
    type Cues = ();
    type Extra = Index;

    fn begin(scene: &Scene, at: &Step<Self>, device: &Device) -> (InitialGaussians, Self) {
        (begin_static(scene, at.config, at.facts), Self::of(scene.train.len(), device))
    }

    fn extra(_view: &View, index: usize, _at: &Step<Self>, _device: &Device) -> Index {
        Index(index)
    }

    fn forward(
        &self,
        gaussians: &Gaussians,
        photos: &[Photo<Index>],
        screens: &[Tensor<2>],
        at: &Step<Self>,
    ) -> Forward {
        let (photo, options) = (&photos[0], at.facts.render_options(&at.config.render, gaussians.sh_degree()));
        let extras = Extras { screen: screens.first().cloned(), features: None, room: at.pair_room() };
        let rendering = render_with(gaussians, &photo.camera, &options, extras);
        let factor = self.factors().narrow(0, photo.extra.0, 1).reshape([1, 1, 1]);
        let image = rendering.color.clone() * factor;
        Forward {
            loss: photometric(image.clone(), photo.image.clone(), photo.mask.clone(), &at.config.loss),
            drawn: vec![Drawn::of(&rendering, screens.first())],
            images: vec![image],
            notes: Vec::new(),
            remainder: None,
        }
    }

    fn update(self, _: &Gaussians, gradients: &mut NamedGradients, adam: &mut Adam, at: &Step<Self>) -> Self {
        adam.update_under("method", self, gradients, |_| Some(AdamRate::new(at.config.method.brightness.lr)))
    }
}

impl Intake for Brightness {
    const ANY_WIDTH: bool = true;

    fn defaults() -> FitConfig<Sections> {
        let shared = Config { pipeline: Self::NAME.into(), ..Config::default() };
        FitConfig { shared, method: Sections::default() }
    }

    fn cues(_scene: &Scene, _config: &FitConfig<Sections>) {}
}

impl Saved for Brightness {
    fn frame(&self) -> serde_json::Value {
        serde_json::json!(self.gains.dims()[0])
    }

    fn from_frame(frame: &serde_json::Value, _: &FitConfig<Sections>, device: &Device) -> Result<Self, String> {
        let photos =
            frame.as_u64().filter(|photos| *photos < 1 << 24).ok_or("the number of photos is missing or absurd")?;
        Ok(Self::of(photos as usize, device))
    }

    /// Takes all photos to be equally bright.
    fn at_rest(scene: &Scene, _: &Step<Self>, device: &Device) -> Result<Self, String> {
        Ok(Self::of(scene.train.len(), device))
    }
}

impl Told for Brightness {
    fn figures(&self, _: &Gaussians, _: &Scene, _: &[View], _: &Step<Self>) -> Figures {
        let factors: Vec<f64> = to_host(self.factors()).into_iter().map(f64::from).collect();
        let widest = |pick: fn(f64, f64) -> f64| factors.iter().copied().reduce(pick).unwrap_or(1.0);
        let spread =
            Figure::new("brightness_ratio", "brightest / darkest photo", widest(f64::max) / widest(f64::min), "");
        Figures { numbers: vec![spread.digits(3).headline()], tables: Vec::new() }
    }
}
