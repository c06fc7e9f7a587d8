//! The pipeline's sections of a configuration: `[motion]`, `[blur]`, `[prior]` and `[cues]`.

use gs_models::sh_bands;
use gs_models::taylormode::losses::{LAMBDA_BLUR, LAMBDA_DEPTH, LAMBDA_SMOOTH, LAMBDA_VELOCITY};
use gs_models::taylormode::order::NOTICEABLE;
use gs_multiview::CueOptions;
use serde::{Deserialize, Serialize};

use crate::config::{self, ConfigError, FitConfig, Section, check, full_width, not_negative, positive, tables};
use crate::fit::initialise::{NEAR_STATIC_CAMERAS, Random};

/// The sections that the pipeline adds.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Sections {
    /// How Gaussians move.
    pub motion: MotionConfig,
    /// How blurred images are formed.
    pub blur: BlurConfig,
    /// Weights of the losses and priors.
    pub prior: PriorConfig,
    /// Heuristics of inference from the photos.
    pub cues: CuesConfig,
}

/// Most Gaussians of a moving scene: a GPU counts moving rows in 24 bits.
const ROWS_MAX: usize = 1 << 24;

impl Section for Sections {
    fn validate(&self, shared: &config::Config) -> Result<(), ConfigError> {
        let cap = shared.density.cap;
        check("density.cap", cap, cap <= ROWS_MAX, "at most 16777216 Gaussians of a moving scene")?;
        full_width(shared)?;
        self.motion.validate()?;
        self.blur.validate()?;
        self.prior.validate()?;
        self.cues.validate()
    }
}

/// The recipe that `pipeline = "taylormode"` stands for.
const BASE: &str = "taylormode/base";

/// The configuration of `pipeline = "taylormode"` alone: the base recipe over the code's defaults.
pub(super) fn defaults() -> FitConfig<Sections> {
    let recipe = gs_recipes::find(BASE).expect("the base recipe is compiled in");
    let mut table = FitConfig::<Sections>::default().to_table();
    tables::merge(&mut table, tables::parse(recipe.text, BASE).expect("the base recipe is TOML"));
    FitConfig::from_table(&table, BASE).expect("the base recipe is valid")
}

/// The source of moving pixels before training.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MaskSource {
    /// The data set's masks of moving objects if it has them, otherwise evidence.
    Auto,
    /// The data set's masks only; without them nothing is known of motion.
    Prior,
    /// Pixels that change over time in front of static cameras.
    Evidence,
    /// No source: every Gaussian may move.
    None,
}

/// The use of a 3D remainder beside the polynomial (Eq. 2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RemainderChoice {
    /// Used if the residual after the best order is structured in time.
    Auto,
    /// From the start.
    On,
    /// Never.
    Off,
}

/// How Gaussians move (Eq. 2 and 3), and the selection of their orders.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MotionConfig {
    /// Order of a Gaussian's path before selection, 0 to 6. A higher order follows stronger curvature, and diverges sooner outside
    /// the window.
    pub order: usize,
    /// Highest initial order of paths. Where the path of the moving object's centre needs more than `order` (by BIC over its
    /// triangulated positions), paths begin with that, up to this. At most 6, at least `order`.
    pub order_max: usize,
    /// Most kinks in a path, 0 to 2: at a time at which the centre's velocity jumps (by BIC), the velocity of every moving Gaussian
    /// may jump.
    pub kinks: usize,
    /// Highest order of a Gaussian's rotation, 0 to 6; 0: the orientation is constant.
    pub rotation_order: usize,
    /// The source of moving pixels before training.
    pub masks: MaskSource,
    /// Initial number of Gaussians that may move.
    pub points: usize,
    /// Share of the run over which the photos used spread from the middle of the recording to its ends; 0: all from the start. Once
    /// its texture is learned at one time, a Gaussian can be tracked to the next; if the whole recording is compared at once, a
    /// repetitive texture converges to the wrong repetition.
    pub curriculum: f64,
    /// Learning rate of the path's coefficients at the first step, scene extents of displacement at the window's edge.
    pub position_lr: f64,
    /// Whether all paths of an object are also updated together, by the sum of their gradients; see
    /// [`common_motion`](super::common_motion).
    pub collective: bool,
    /// Learning rate of the rotation's coefficients at the first step, radians at the window's edge.
    pub rotation_lr: f64,
    /// Both rates at the last step, as a share of the first.
    pub final_share: f64,
    /// The use of the 3D remainder.
    pub remainder: RemainderChoice,
    /// Learning rate of the remainder's network (paper: 1e-4 for all networks). All Gaussians share the network, so a larger rate
    /// perturbs the whole object at each step.
    pub remainder_lr: f64,
    /// Whether each Gaussian keeps only the order that it needs; otherwise all keep `order`.
    pub select: bool,
    /// Share of the run after which orders are first selected.
    pub select_from: f64,
    /// Steps from one selection to the next.
    pub select_every: usize,
    /// Largest change of a Gaussian's position in any training view, pixels, at which a lower order is accepted.
    pub select_pixels: f64,
    /// Soft threshold of each coefficient block at each selection, pixels at the window's edge.
    pub shrink_pixels: f64,
    /// Largest change of a colour channel, 0 to 1, at which a lower degree of a Gaussian's view-dependent colour is accepted.
    pub select_color: f64,
    /// Soft threshold of each band at each selection, 0 to 1.
    pub shrink_color: f64,
}

impl Default for MotionConfig {
    fn default() -> Self {
        Self {
            order: 3,
            order_max: 6,
            kinks: 2,
            rotation_order: 2,
            masks: MaskSource::Auto,
            points: 4000,
            curriculum: 0.4,
            position_lr: 1e-3,
            collective: true,
            rotation_lr: 2e-3,
            final_share: 0.02,
            remainder: RemainderChoice::Auto,
            remainder_lr: 1e-4,
            select: true,
            select_from: 0.5,
            select_every: 100,
            select_pixels: NOTICEABLE,
            shrink_pixels: 0.02,
            select_color: sh_bands::NOTICEABLE,
            shrink_color: sh_bands::NOTICEABLE,
        }
    }
}

/// Formation of the image that is compared with a blurry photo.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BlurMode {
    /// The exact formation: the mean of renderings at times inside the exposure.
    Integrate,
    /// The paper's formation: the sharp image gathered along the velocity at each pixel (Eq. 7 to 12).
    Warp,
    /// No blur model: the sharp rendering is compared with the blurry photo (ITG, Table 1).
    None,
}

/// The source of the warp's velocity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum VelocitySource {
    /// The derivative of the Taylor motion, splatted (Eq. 3 and 4).
    Taylor,
    /// A network alone (the row "w/o Taylor Expansion" of Table 2).
    Network,
}

/// How blurred images are formed (section 3.3).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BlurConfig {
    /// The formation.
    pub mode: BlurMode,
    /// Times inside the exposure (paper: N = 7). Too few show as separate copies if an object moves by more than N pixels.
    pub samples: usize,
    /// `integrate`: share of the run in which three times are taken in place of `samples`, 0 to 1. They cost half as much, and what they
    /// miss of fast motion the rest of the run finds.
    pub few_until: f64,
    /// Initial exposure, in the data set's unit of time; 0: as the data set states, else half a frame interval.
    pub exposure: f64,
    /// Whether the exposure is learned.
    pub learn_exposure: bool,
    /// Learning rate of the exposure's logarithm.
    pub exposure_lr: f64,
    /// Share of the run after which the exposure is learned, if the data set states it (1: never); else it is learned from the
    /// start. The estimate from photos alone is too short, because the scene's own softness explains part of the blur: by 2 to 3 %
    /// at 256 x 192 pixels, by 6 to 20 % at 96 x 72.
    pub exposure_from: f64,
    /// Whether light is averaged linearly, as in a sensor; otherwise in the encoding of the photos.
    pub linear: bool,
    /// Whether static Gaussians get no gradient from the blurred image (section 3.4, gradient decoupling).
    pub decouple: bool,
    /// `warp`: share of the depth prior in the hybrid depth (paper: 0.3).
    pub depth_beta: f64,
    /// `warp`: the source of velocities.
    pub velocity: VelocitySource,
    /// `warp`: whether the Peano remainder network corrects velocities (Eq. 5).
    pub peano: bool,
    /// `warp`: whether a network weights the samples (Eq. 11); otherwise all have equal weights.
    pub weights: bool,
    /// Learning rate of the networks (paper: 1e-4).
    pub network_lr: f64,
}

/// Times inside the exposure in the first part of a run: the fewest that tell its middle from its ends.
const FEW: usize = 3;

impl BlurConfig {
    /// Times inside the exposure of a step before which the share `progress` of the run has passed.
    pub fn samples_at(&self, progress: f64) -> usize {
        if progress < self.few_until { self.samples.min(FEW) } else { self.samples }
    }
}

impl Default for BlurConfig {
    fn default() -> Self {
        Self {
            mode: BlurMode::Integrate,
            samples: 7,
            few_until: 0.0,
            exposure: 0.0,
            learn_exposure: true,
            exposure_lr: 2e-3,
            exposure_from: 1.0,
            linear: true,
            decouple: true,
            depth_beta: 0.3,
            velocity: VelocitySource::Taylor,
            peano: true,
            weights: true,
            network_lr: 1e-4,
        }
    }
}

/// How a depth prior is compared with the rendered depth. A prior that the data set calls metric is used as it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum DepthFit {
    /// Scaled and shifted per photo, then Eq. 16.
    Photo,
    /// Unchanged, Eq. 16.
    None,
    /// One minus the correlation, which is invariant to scale and shift. (The hybrid depth of Eq. 6 is fitted per photo.)
    Correlation,
}

/// Weights of the terms of Eq. 19 and of their priors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PriorConfig {
    /// Weight of the sharp term (Eq. 14).
    pub sharp: f64,
    /// Weight of the blurred term (Eq. 15).
    pub blur: f64,
    /// Weight of the depth term (Eq. 16).
    pub depth: f64,
    /// Weight of the velocity term (Eq. 17).
    pub velocity: f64,
    /// Weight of the smoothness of blur weights (Eq. 18).
    pub smooth: f64,
    /// Whether the pseudo-sharp photo replaces the blurry one at moving pixels (Eq. 13).
    pub pseudo: bool,
    /// How depth priors are compared with the rendered depth.
    pub depth_fit: DepthFit,
    /// Share of the run after which priors (pseudo-sharp, depth, guide) are no longer used; 1: they always are. Priors help at
    /// first, and their errors limit quality at the end.
    pub until: f64,
}

impl Default for PriorConfig {
    fn default() -> Self {
        Self {
            sharp: 1.0,
            blur: LAMBDA_BLUR,
            depth: LAMBDA_DEPTH,
            velocity: LAMBDA_VELOCITY,
            smooth: LAMBDA_SMOOTH,
            pseudo: true,
            depth_fit: DepthFit::Photo,
            until: 1.0,
        }
    }
}

/// Highest accepted order of a path: at higher orders, powers of the normalised time are nearly dependent in f32.
const MAX_ORDER: usize = 6;

/// Most kinks of a path: with three, any one wrong centre becomes a spike.
const MAX_KINKS: usize = 2;

impl MotionConfig {
    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        check("motion.order", self.order, self.order <= MAX_ORDER, "from 0 to 6")?;
        let above = (self.order..=MAX_ORDER).contains(&self.order_max);
        check("motion.order_max", self.order_max, above, "from motion.order to 6")?;
        check("motion.kinks", self.kinks, self.kinks <= MAX_KINKS, "from 0 to 2")?;
        check("motion.rotation_order", self.rotation_order, self.rotation_order <= MAX_ORDER, "from 0 to 6")?;
        check("motion.points", self.points, self.points >= 1, "at least 1")?;
        check("motion.curriculum", self.curriculum, (0.0..=1.0).contains(&self.curriculum), "from 0 to 1")?;
        check("motion.position_lr", self.position_lr, not_negative(self.position_lr), "0 or more")?;
        check("motion.rotation_lr", self.rotation_lr, not_negative(self.rotation_lr), "0 or more")?;
        check("motion.remainder_lr", self.remainder_lr, not_negative(self.remainder_lr), "0 or more")?;
        check("motion.final_share", self.final_share, positive(self.final_share), "positive")?;
        check("motion.select_from", self.select_from, (0.0..=1.0).contains(&self.select_from), "from 0 to 1")?;
        check("motion.select_every", self.select_every, self.select_every >= 1, "at least 1")?;
        check("motion.select_pixels", self.select_pixels, not_negative(self.select_pixels), "0 or more")?;
        check("motion.shrink_pixels", self.shrink_pixels, not_negative(self.shrink_pixels), "0 or more")?;
        check("motion.select_color", self.select_color, not_negative(self.select_color), "0 or more")?;
        check("motion.shrink_color", self.shrink_color, not_negative(self.shrink_color), "0 or more")
    }
}

impl BlurConfig {
    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        let least = if self.mode == BlurMode::None { 1 } else { 2 };
        check("blur.samples", self.samples, (least..=1025).contains(&self.samples), "from 2 to 1025")?;
        check("blur.few_until", self.few_until, (0.0..=1.0).contains(&self.few_until), "from 0 to 1")?;
        check("blur.exposure", self.exposure, not_negative(self.exposure), "0 (from the data set) or positive")?;
        check("blur.exposure_lr", self.exposure_lr, not_negative(self.exposure_lr), "0 or more")?;
        check("blur.exposure_from", self.exposure_from, (0.0..=1.0).contains(&self.exposure_from), "from 0 to 1")?;
        check("blur.depth_beta", self.depth_beta, (0.0..=1.0).contains(&self.depth_beta), "from 0 to 1")?;
        check("blur.network_lr", self.network_lr, not_negative(self.network_lr), "0 or more")
    }
}

impl PriorConfig {
    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        check("prior.sharp", self.sharp, not_negative(self.sharp), "0 or more")?;
        check("prior.blur", self.blur, not_negative(self.blur), "0 or more")?;
        check("prior.depth", self.depth, not_negative(self.depth), "0 or more")?;
        check("prior.velocity", self.velocity, not_negative(self.velocity), "0 or more")?;
        check("prior.smooth", self.smooth, not_negative(self.smooth), "0 or more")?;
        check("prior.until", self.until, (0.0..=1.0).contains(&self.until), "from 0 to 1")
    }
}

/// Heuristics of inference from the photos. Lengths in images are shares of the image width; they were chosen at 256 to 320 pixels.
/// `gs-lab experiments taylormode --only sensitivity` halves and doubles each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CuesConfig {
    /// Near plane of scenes with static cameras and without points, as a share of the cameras' median distance from the subject.
    /// Smaller: floaters close to one camera explain its photos alone. Larger: a near wall is culled. Twelve cameras all around,
    /// 800 steps, a held-out camera: 19.2 dB without, 17.9 at 0.2, 25.5 at 0.3, 25.9 at 0.6.
    pub near_share: f64,
    /// Smallest depth of random points at pixels without texture, in distances of the subject. Photos do not constrain the depth of
    /// a sky. Smaller: points that begin between the cameras stay there as floaters. Larger: a plain wall is missed. Random points end
    /// at 3 distances.
    pub plain_nearest: f64,
    /// Largest root mean square distance of an object's centres from its path, as a share of the image width, at which it is an
    /// object of its own. Larger: fragments become objects. Smaller: objects with inaccurate masks get no path.
    pub body_size: f64,
    /// Largest such distance for the centre of all moving pixels at which its path is used. Larger: the common centre of several
    /// people misleads all Gaussians. Smaller: an object with inaccurate masks begins without a path.
    pub followed: f64,
    /// Root mean square distance, as a share of the image width, by which a path with fewer orders and kinks may miss a centre. The
    /// outline of an object that turns differs between cameras, so its centre's path is not known more precisely. Larger: motion is
    /// lost (0.15 dB from 0.6 pixels of 256 on). Smaller: noise is fitted.
    pub unseen: f64,
    /// Motion by each of the nine linear numbers of a common step at twice the object's extent, as a factor of the paths' rate.
    /// Larger: the object jitters. Smaller: it converges to the nearest match of its texture before it has turned, and lags behind.
    pub turn: f64,
    /// Scales the acceptance of shadows, 0 to 2. Larger: dark objects vanish from the masks. Smaller: shadows join them.
    pub shadow: f64,
    /// Smallest moving region that is kept, as a share of the image's area. Larger: small objects vanish. Smaller: flicker shifts
    /// centres.
    pub speck: f64,
}

impl Default for CuesConfig {
    fn default() -> Self {
        let CueOptions { masks, objects, .. } = CueOptions::default();
        Self {
            near_share: NEAR_STATIC_CAMERAS,
            plain_nearest: Random::STATIC_CAMERAS.plain_nearest,
            body_size: objects.body_size,
            followed: objects.followed,
            unseen: 0.5 / gs_multiview::REFERENCE_WIDTH,
            turn: 6.0,
            shadow: masks.shadow,
            speck: masks.speck,
        }
    }
}

impl CuesConfig {
    /// The heuristics as options of the inference.
    pub fn options(&self) -> CueOptions {
        let mut options = CueOptions::default();
        options.objects.body_size = self.body_size;
        options.objects.followed = self.followed;
        options.masks.shadow = self.shadow;
        options.masks.speck = self.speck;
        options
    }

    pub(crate) fn validate(&self) -> Result<(), ConfigError> {
        check(
            "cues.near_share",
            self.near_share,
            positive(self.near_share) && self.near_share < 1.0,
            "above 0, below 1",
        )?;
        let plain = (0.3..=2.9).contains(&self.plain_nearest);
        check("cues.plain_nearest", self.plain_nearest, plain, "from 0.3 to 2.9")?;
        let share = |x: f64| positive(x) && x <= 0.1;
        check("cues.body_size", self.body_size, share(self.body_size), "above 0, at most 0.1")?;
        check("cues.followed", self.followed, share(self.followed), "above 0, at most 0.1")?;
        check("cues.unseen", self.unseen, share(self.unseen), "above 0, at most 0.1")?;
        check("cues.turn", self.turn, not_negative(self.turn), "0 or more")?;
        check("cues.shadow", self.shadow, (0.0..=2.0).contains(&self.shadow), "from 0 to 2")?;
        check("cues.speck", self.speck, (0.0..=0.01).contains(&self.speck), "from 0 to 0.01")
    }
}
