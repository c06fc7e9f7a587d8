//! `static`: plain 3D Gaussian Splatting of a static scene, the empty method.

use burn::module::Module;
use burn::tensor::{Device, Tensor};
use gs_burn::{Extras, Gaussians, RenderOptions, Rendering, render_with};
use gs_datasets::{LoadOptions, PriorUse, Scene, View, surveyed};
use gs_models::light::Mixing;

use gs_train::config::{FitConfig, NOT_NEGATIVE, Section};
use gs_train::fit::coarse::dilation;
use gs_train::fit::depth::{Depths, PhotoDepth};
use gs_train::fit::facts::Unseen;
use gs_train::fit::initialise::{InitialGaussians, dense_count};
use gs_train::fit::intake::Intake;
use gs_train::fit::losses::photometric;
use gs_train::fit::method::{Drawn, Forward, Method, Step, begin_static};
use gs_train::fit::photos::Photo;
use gs_train::fit::saved::Saved;
use gs_train::fit::shutter::{Instant, formed};
use gs_train::fit::told::{Introduction, Told};
use gs_train::section;

section! {
    /// The section that the pipeline adds.
    pub struct Sections {
        /// Depth priors.
        depth: DepthConfig;
    }
}

impl Section for Sections {}

section! {
    /// Depth priors.
    pub struct DepthConfig {
        /// Weight of the difference of the logarithms of rendered and prior depth.
        weight: f64 = 1.0, in NOT_NEGATIVE;
    }
}

/// The empty method: nothing is learned beside the Gaussians.
#[derive(Module, Debug)]
pub struct Still {}

impl Method for Still {
    const NAME: &'static str = "static";
    type Config = Sections;
    type Cues = Depths;
    type Extra = PhotoDepth;

    fn begin(scene: &Scene, at: &Step<Self>, _device: &Device) -> (InitialGaussians, Self) {
        let wanted = dense_count(&scene.train, at.config.init.dense_share, at.config.density.cap);
        let views = surveyed(&scene.train);
        let points = at.cues.with_points(views, scene.points.as_ref(), wanted, at.config.seed);
        (begin_static(views, points.as_ref(), at.config, at.facts), Self {})
    }

    fn extra(view: &View, index: usize, at: &Step<Self>, _device: &Device) -> PhotoDepth {
        at.cues.of_view(view, index)
    }

    fn forward(
        &self,
        gaussians: &Gaussians,
        photos: &[Photo<PhotoDepth>],
        screens: &[Tensor<2>],
        at: &Step<Self>,
    ) -> Forward {
        let photo = &photos[0];
        let options = at.facts.render_options(&at.config.render, gaussians.sh_degree());
        let eps2d = dilation(options.eps2d, photo.pixel);
        let options = RenderOptions { eps2d, depth: photo.extra.is_known(), ..options };
        let extras = Extras { screen: screens.first().cloned(), features: None, room: at.pair_room() };
        let instants = photo.instants(1);
        let rendered =
            |instant: &Instant| render_with(gaussians, &instant.camera, &instant.options(&options), extras.clone());
        let renderings: Vec<Rendering> = instants.iter().map(rendered).collect();
        let image = photo.taken(formed(&instants, &renderings, Mixing::Linear));
        let loss = photometric(image.clone(), photo.image.clone(), photo.mask.clone(), &at.config.loss);
        let middle = instants.len() / 2;
        let centre = || match instants[middle].is_whole() {
            true => renderings[middle].clone(),
            false => rendered(&Instant::still(photo.middle())),
        };
        let misfit = options.depth.then(|| photo.extra.misfit(&centre(), photo.mask.as_ref())).flatten();
        let of_depth = misfit.map(|misfit| misfit * at.config.method.depth.weight);
        let loss = of_depth.map_or(loss.clone(), |term| loss + term);
        Forward {
            // A mean over the pixels that count: beside one over all, the regularisers would be stronger. Where all
            // count, a GPU gets no launch for it.
            loss: if photo.share == 1.0 { loss } else { loss / photo.share },
            drawn: vec![Drawn::of_all(&renderings, screens.first())],
            images: vec![image],
            notes: Vec::new(),
            remainder: None,
        }
    }
}

impl Intake for Still {
    const ANY_WIDTH: bool = true;
    const ON_DEMAND: bool = true;
    const UNSEEN: Unseen = Unseen::MeanColor;

    fn defaults() -> FitConfig<Sections> {
        FitConfig::default()
    }

    fn loading(config: &FitConfig<Sections>, options: &mut LoadOptions) {
        // Pseudo-sharp photos are compared with none. Masks of moving objects are kept, because moving parts are
        // measured with them.
        let depth = options.priors.depth && config.method.depth.weight > 0.0;
        options.priors = PriorUse { depth, sharp: false, ..options.priors };
    }

    fn cues(scene: &Scene, _config: &FitConfig<Sections>) -> Depths {
        Depths::of(&scene.train, scene.points.as_ref())
    }
}

impl Saved for Still {
    fn from_frame(_frame: &serde_json::Value, _config: &FitConfig<Sections>, _device: &Device) -> Result<Self, String> {
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
