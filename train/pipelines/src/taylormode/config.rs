//! The pipeline's sections of a configuration: `[motion]`, `[blur]`, `[prior]` and `[cues]`.

use gs_models::taylormode::losses::{LAMBDA_BLUR, LAMBDA_DEPTH, LAMBDA_SMOOTH, LAMBDA_VELOCITY};
use gs_models::taylormode::order::NOTICEABLE;
use gs_multiview::CueOptions;

use gs_train::config::{
    self, ConfigError, FitConfig, NOT_NEGATIVE, Only, POSITIVE, SHARE, Section, check, not_negative, of_moving_scenes,
    positive, tables,
};
use gs_train::fit::initialise::{NEAR_STATIC_CAMERAS, Random};
use gs_train::{choice, section};

section! {
    /// The sections that the pipeline adds.
    pub struct Sections {
        /// How Gaussians move.
        motion: MotionConfig;
        /// How blurred images are formed.
        blur: BlurConfig;
        /// Weights of the losses and priors.
        prior: PriorConfig;
        /// Heuristics of inference from the photos.
        cues: CuesConfig;
    }
}

/// Most Gaussians of a moving scene: a GPU counts moving rows in 24 bits.
const ROWS_MAX: usize = 1 << 24;

impl Section for Sections {
    fn check_beside(&self, shared: &config::Config) -> Result<(), ConfigError> {
        let cap = shared.density.cap;
        check("density.cap", cap, cap <= ROWS_MAX, "at most 16777216 Gaussians of a moving scene")?;
        // Where the camera moves, all that is seen is blurred: depth and velocity at a pixel do not form it.
        let (camera, blur) = (&shared.camera, &self.blur);
        let forms = camera.motion == 0 || (blur.mode == BlurMode::Integrate && !blur.decouple);
        check("camera.motion", camera.motion, forms, "0 without blur.mode = \"integrate\" and blur.decouple = false")?;
        let poses = !camera.refine || blur.mode != BlurMode::Warp;
        check("camera.refine", camera.refine, poses, "false with blur.mode = \"warp\"")?;
        of_moving_scenes(shared)
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

choice! {
    /// The source of moving pixels before training.
    pub enum MaskSource {
        /// The data set's masks if it has them, else evidence.
        Auto,
        /// The data set's masks alone.
        Prior,
        /// Pixels that change over time in front of static cameras.
        Evidence,
        /// No source: every Gaussian may move.
        None,
    }
}

choice! {
    /// The use of a 3D remainder beside the polynomial (Eq. 2).
    pub enum RemainderChoice {
        /// Used where the residual after the best order is structured in time.
        Auto,
        /// From the start.
        On,
        /// Never.
        Off,
    }
}

section! {
    /// How Gaussians move (Eq. 2 and 3), and the selection of their orders.
    pub struct MotionConfig {
        /// Least order with which a Gaussian's path begins.
        order: usize = 3, in 0..=MAX_ORDER;
        /// Highest order of a path. Paths begin with the order that the centre of their object needs (by BIC, from
        /// `order` to 6); higher ones are learned as `curriculum` opens the recording.
        order_max: usize = 10;
        /// Most kinks in a path, times at which the velocity of every moving Gaussian may jump, as the centre's does
        /// (by BIC).
        kinks: usize = 2, in 0..=MAX_KINKS;
        /// Highest order of a rotation; 0: orientations are constant. Gaussians of a body turn as it does.
        rotation_order: usize = 2, in 0..=MAX_ORDER;
        /// The source of moving pixels before training.
        masks: MaskSource = MaskSource::Auto;
        /// Initial number of Gaussians that may move.
        points: usize = 4000, in 1..;
        /// Share of the run over which photos spread from the middle of the recording to its ends. Less: a repetitive
        /// texture converges to the wrong repetition.
        curriculum: f64 = 0.4, in SHARE;
        /// Learning rate of a path's coefficients at the first step, scene extents of displacement at the window's
        /// edge.
        position_lr: f64 = 1e-3, in NOT_NEGATIVE;
        /// Whether the Gaussians of a body move together: by one path for the first fifth of the run, then also by the
        /// sum of their gradients.
        collective: bool = true;
        /// The same of a rotation's coefficients, radians.
        rotation_lr: f64 = 2e-3, in NOT_NEGATIVE;
        /// Both rates at the last step, as a share of the first.
        final_share: f64 = 0.02, in POSITIVE;
        /// The use of the 3D remainder.
        remainder: RemainderChoice = RemainderChoice::Auto;
        /// Whether each Gaussian keeps only the order that it needs.
        select: bool = true;
        /// Steps from one selection to the next.
        select_every: usize = 100, in 1..;
        /// Largest change of a Gaussian's position in a training view, pixels, at which a lower order is accepted; four
        /// times as much where the photos do not ask for the motion.
        select_pixels: f64 = NOTICEABLE, in NOT_NEGATIVE;
        /// Soft threshold of each coefficient block beside those of the body, at each selection, pixels.
        shrink_pixels: f64 = 0.05, in NOT_NEGATIVE;
    }
    also check_orders;
}

choice! {
    /// Formation of the image that is compared with a blurry photo.
    pub enum BlurMode {
        /// The mean of renderings at times inside the exposure (exact).
        Integrate,
        /// The paper's: the sharp image gathered along the velocity at each pixel (Eq. 7 to 12).
        Warp,
        /// No blur model (ITG, Table 1).
        None,
    }
}

choice! {
    /// The source of the warp's velocity.
    pub enum VelocitySource {
        /// The derivative of the Taylor motion, splatted (Eq. 3 and 4).
        Taylor,
        /// A network alone (Table 2, "w/o Taylor Expansion").
        Network,
    }
}

section! {
    /// How blurred images are formed (section 3.3).
    pub struct BlurConfig {
        /// The formation.
        mode: BlurMode = BlurMode::Integrate;
        /// Times inside the exposure (paper: 7). Too few show as separate copies of an object that moves by more
        /// pixels.
        samples: usize = 7;
        /// `integrate`: share of the run in which three times are taken in place of `samples`, at half the cost.
        few_until: f64 = 0.0, in SHARE;
        /// Initial exposure, in the data set's unit of time; 0: as it states, else half a frame interval.
        exposure: f64 = 0.0, in Only("0 (from the data set) or positive", |exposure| not_negative(*exposure));
        /// Whether the exposure is learned.
        learn_exposure: bool = true;
        /// Learning rate of the exposure's logarithm.
        exposure_lr: f64 = 2e-3, in NOT_NEGATIVE;
        // By 2 to 3 % at 256 x 192 pixels, by 6 to 20 % at 96 x 72.
        /// Share of the run after which an exposure that the data set states is learned; 1: never. Photos alone give a
        /// too short one, because the scene's own softness explains part of the blur.
        exposure_from: f64 = 1.0, in SHARE;
        /// Whether light is averaged linearly, as in a sensor.
        linear: bool = true;
        /// Whether static Gaussians get no gradient from the blurred image (section 3.4).
        decouple: bool = true;
        /// `warp`: share of the depth prior in the hybrid depth (paper: 0.3).
        depth_beta: f64 = 0.3, in SHARE;
        /// `warp`: the source of velocities.
        velocity: VelocitySource = VelocitySource::Taylor;
        /// `warp`: whether the Peano remainder network corrects velocities (Eq. 5).
        peano: bool = true;
        /// `warp`: whether a network weights the samples (Eq. 11); otherwise all have equal weights.
        weights: bool = true;
        /// Learning rate of the networks (paper: 1e-4).
        network_lr: f64 = 1e-4, in NOT_NEGATIVE;
    }
    also check_samples;
}

/// Times inside the exposure in the first part of a run: the fewest that tell its middle from its ends.
const FEW: usize = 3;

impl BlurConfig {
    /// Times inside the exposure of a step before which the share `progress` of the run has passed.
    pub fn samples_at(&self, progress: f64) -> usize {
        if progress < self.few_until { self.samples.min(FEW) } else { self.samples }
    }
}

choice! {
    /// How a depth prior is compared with the rendered depth. A prior that the data set calls metric is used as it is.
    pub enum DepthFit {
        /// Scaled and shifted per photo, then Eq. 16.
        Photo,
        /// Unchanged, Eq. 16.
        None,
        /// One minus the correlation.
        Correlation,
    }
}

section! {
    /// Weights of the terms of Eq. 19 and of their priors.
    pub struct PriorConfig {
        /// Weight of the sharp term (Eq. 14).
        sharp: f64 = 1.0, in NOT_NEGATIVE;
        /// Weight of the blurred term (Eq. 15).
        blur: f64 = LAMBDA_BLUR, in NOT_NEGATIVE;
        /// Weight of the depth term (Eq. 16).
        depth: f64 = LAMBDA_DEPTH, in NOT_NEGATIVE;
        /// Weight of the velocity term (Eq. 17).
        velocity: f64 = LAMBDA_VELOCITY, in NOT_NEGATIVE;
        /// Weight of the smoothness of blur weights (Eq. 18).
        smooth: f64 = LAMBDA_SMOOTH, in NOT_NEGATIVE;
        /// Whether the pseudo-sharp photo replaces the blurry one at moving pixels (Eq. 13).
        pseudo: bool = true;
        /// The comparison of depth priors with the rendered depth.
        depth_fit: DepthFit = DepthFit::Photo;
        /// Share of the run after which priors are no longer used: they help at first, and their errors limit quality
        /// at the end.
        until: f64 = 1.0, in SHARE;
    }
}

/// Highest accepted order of a path: above, Taylor's coefficients in f32, which files store, lose a thousandth of the
/// path's length.
const MAX_ORDER: usize = 12;

/// Most kinks of a path: with three, any one wrong centre becomes a spike.
const MAX_KINKS: usize = 2;

fn check_orders(motion: &MotionConfig) -> Result<(), ConfigError> {
    let above = (motion.order..=MAX_ORDER).contains(&motion.order_max);
    check("motion.order_max", motion.order_max, above, "from motion.order to 12")
}

fn check_samples(blur: &BlurConfig) -> Result<(), ConfigError> {
    let least = if blur.mode == BlurMode::None { 1 } else { 2 };
    check("blur.samples", blur.samples, (least..=1025).contains(&blur.samples), "from 2 to 1025")
}

/// Shares of an image that a heuristic may take for small.
const SMALL_SHARE: Only<f64> = Only("above 0, at most 0.1", |share| positive(*share) && *share <= 0.1);

section! {
    /// Heuristics of inference from the photos. Lengths in images are shares of the image width; they were chosen at
    /// 256 to 320 pixels. `gs-lab experiments taylormode --only sensitivity` halves and doubles each.
    pub struct CuesConfig {
        // Twelve cameras all around, 800 steps, a held-out camera: 19.2 dB without, 17.9 at 0.2, 25.5 at 0.3, 25.9 at
        // 0.6.
        /// Near plane of scenes with static cameras and without points, in median distances of the cameras from the
        /// subject. Smaller: floaters close to one camera. Larger: a near wall is culled.
        near_share: f64 = NEAR_STATIC_CAMERAS, in Only("above 0, below 1", |share| positive(*share) && *share < 1.0);
        /// Smallest depth of random points at pixels without texture, in distances of the subject. Smaller: floaters
        /// between the cameras. Larger: a plain wall is missed.
        plain_nearest: f64 = Random::STATIC_CAMERAS.plain_nearest, in 0.3..=2.9;
        /// Largest root mean square distance of an object's centres from its path, in image widths. Larger: fragments
        /// become objects. Smaller: objects with inaccurate masks get no path.
        body_size: f64 = CueOptions::default().objects.body_size, in SMALL_SHARE;
        /// The same for the centre of all moving pixels. Larger: the common centre of several people misleads all
        /// Gaussians.
        followed: f64 = CueOptions::default().objects.followed, in SMALL_SHARE;
        // The outline of an object that turns differs between cameras, so its centre's path is not known more
        // precisely. From 0.6 pixels of 256 on, 0.15 dB are lost.
        /// Root mean square distance by which a path with fewer orders and kinks may miss a centre, in image widths.
        /// Larger: motion is lost. Smaller: noise is fitted.
        unseen: f64 = 0.5 / gs_multiview::REFERENCE_WIDTH, in SMALL_SHARE;
        /// Rate of the nine linear numbers of a common step at twice the object's extent, in rates of the paths.
        /// Larger: the object jitters. Smaller: it lags behind a turn.
        turn: f64 = 6.0, in NOT_NEGATIVE;
        /// Factor on the acceptance of shadows. Larger: dark objects vanish from the masks. Smaller: shadows join them.
        shadow: f64 = CueOptions::default().masks.shadow, in 0.0..=2.0;
        /// Smallest moving region that is kept, as a share of the image. Larger: small objects vanish. Smaller: flicker
        /// shifts centres.
        speck: f64 = CueOptions::default().masks.speck, in 0.0..=0.01;
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
}
