//! `static`: plain 3D Gaussian Splatting of a static scene, the empty method.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use gs_burn::{Extras, Gaussians, RenderOptions, render_with};
use gs_datasets::{LoadOptions, PriorUse, Scene, View};

use gs_train::config::{FitConfig, NoSection};
use gs_train::fit::coarse::dilation;
use gs_train::fit::facts::Unseen;
use gs_train::fit::initialise::InitialGaussians;
use gs_train::fit::intake::Intake;
use gs_train::fit::losses::photometric;
use gs_train::fit::method::{Drawn, Forward, Method, Step, begin_static};
use gs_train::fit::photos::Photo;
use gs_train::fit::saved::Saved;
use gs_train::fit::told::{Introduction, Told};

/// The empty method: nothing is learned beside the Gaussians.
#[derive(Module, Debug)]
pub struct Still {}

impl Method for Still {
    const NAME: &'static str = "static";
    type Config = NoSection;
    type Cues = ();
    type Extra = ();

    fn begin(scene: &Scene, at: &Step<Self>, _device: &Device) -> (InitialGaussians, Self) {
        (begin_static(scene, at.config, at.facts), Self {})
    }

    fn extra(_view: &View, _index: usize, _at: &Step<Self>, _device: &Device) {}

    fn forward(&self, gaussians: &Gaussians, photos: &[Photo<()>], screens: &[Tensor<2>], at: &Step<Self>) -> Forward {
        let photo = &photos[0];
        let options = at.facts.render_options(&at.config.render, gaussians.sh_degree());
        let options = RenderOptions { eps2d: dilation(options.eps2d, photo.pixel), ..options };
        let extras = Extras { screen: screens.first().cloned(), features: None, room: at.pair_room() };
        let rendering = render_with(gaussians, &photo.camera, &options, extras);
        let image = photo.taken(rendering.color.clone());
        Forward {
            loss: photometric(image.clone(), photo.image.clone(), photo.mask.clone(), &at.config.loss),
            drawn: vec![Drawn::of(&rendering, screens.first())],
            images: vec![image],
            notes: Vec::new(),
            remainder: None,
        }
    }
}

impl Intake for Still {
    const ANY_WIDTH: bool = true;
    const UNSEEN: Unseen = Unseen::MeanColor;

    fn defaults() -> FitConfig<NoSection> {
        FitConfig::default()
    }

    fn loading(_config: &FitConfig<NoSection>, options: &mut LoadOptions) {
        // A static scene is compared with neither depth nor pseudo-sharp photos. Masks of moving objects are kept,
        // because moving parts are measured with them.
        options.priors = PriorUse { depth: false, sharp: false, ..options.priors };
    }

    fn cues(_scene: &Scene, _config: &FitConfig<NoSection>) {}
}

impl Saved for Still {
    fn from_frame(
        _frame: &serde_json::Value,
        _config: &FitConfig<NoSection>,
        _device: &Device,
    ) -> Result<Self, String> {
        Ok(Self {})
    }
}

impl Told for Still {
    fn introduction(&self, scene: &Scene, _at: &Step<Self>) -> Introduction {
        let moves = scene.time_range.is_some_and(|(low, high)| low < high);
        let warning = "the photos have times, but this pipeline takes the scene to be static; for moving scenes: \
                       --recipe taylormode/base";
        let warnings = moves.then(|| warning.to_string()).into_iter().collect();
        Introduction { warnings, ..Introduction::default() }
    }
}
