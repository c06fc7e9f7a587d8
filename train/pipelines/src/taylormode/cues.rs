//! Cues about motion, inferred from the photos before training: masks, the paths of moving objects' centres, the
//! recording's middle and length, the exposure.

use gs_base::median;
use gs_datasets::{Scene, View};
use gs_models::taylormode::{TaylorMotion, TimeWindow};
use gs_multiview::{self as multiview, Centre, ImageScale, MaskOptions, MaskOrigin, MovingMasks, Track};

use super::Config;
use super::config::{BlurMode, MaskSource};
use gs_train::fit::told::{MOVING, Region, given_regions};

/// Cues about motion, inferred from the training photos alone.
#[derive(Debug, Clone, Default)]
pub struct Cues {
    /// Per training view: the moving pixels, and their source; empty if none were searched for.
    pub masks: MovingMasks,
    /// Per training view: world velocity of the centre of moving pixels, scene units per unit of time; empty likewise.
    pub guides: Vec<Option<[f64; 3]>>,
    /// The centre of all moving pixels, by time.
    pub centres: Vec<Centre>,
    /// Objects that move separately, each with the path of its centre; a single one for all moving pixels if there are
    /// no two.
    pub tracks: Vec<Track>,
    /// Pixels and image widths per scene unit at the centre.
    pub scale: ImageScale,
    /// Warnings about omitted cues and loss terms.
    pub warnings: Vec<String>,
}

/// Warnings about priors that the loss uses and no training view has.
fn absent(scene: &Scene, config: &Config) -> Vec<String> {
    let has = |found: fn(&View) -> bool| scene.train.iter().any(found);
    let mut said = Vec::new();
    if config.method.prior.depth > 0.0 && !has(|view| view.priors.depth.is_some()) {
        said.push("no depth priors: the depth term (Eq. 16) is left out".into());
    }
    if config.method.prior.pseudo && config.method.prior.sharp > 0.0 && !has(|view| view.priors.sharp.is_some()) {
        said.push("no pseudo-sharp photos (Eq. 13): training has the blurry ones alone".into());
    }
    said
}

/// Warnings about loss terms for which the data set has no input.
fn without_basis(masks: &MovingMasks, guides: &[Option<[f64; 3]>], objects: usize, config: &Config) -> Vec<String> {
    if config.method.blur.mode != BlurMode::Warp {
        return Vec::new();
    }
    let mut said = Vec::new();
    if masks.masks.iter().all(Option::is_none) {
        said.push(
            "no masks: the blurred term (Eq. 15) counts all pixels, and no background is protected from it".into(),
        );
    }
    if config.method.prior.velocity > 0.0 && guides.iter().all(Option::is_none) {
        let why = if objects > 1 { "objects move apart" } else { "no path of an object's centre" };
        said.push(format!("{why}: the guide velocity (Eq. 17) is left out"));
    }
    said
}

/// Removes photos without a time if others have one: their state of the scene is unknown.
pub fn leave_out_timeless(scene: &mut Scene) {
    let count = |scene: &Scene| scene.train.len() + scene.held_out_views().count();
    let before = count(scene);
    if scene.time_range.is_some() {
        scene.train.retain(|view| view.time.is_some());
        scene.held_out.iter_mut().for_each(|split| split.views.retain(|view| view.time.is_some()));
        scene.held_out.retain(|split| !split.views.is_empty());
    }
    scene.warnings.extend(left_out_warning(before - count(scene)));
}

/// The warning about photos without a time, if there are any.
pub fn left_out_warning(photos: usize) -> Option<String> {
    (photos > 0).then(|| format!("{photos} photos without a time are left out"))
}

/// The moving parts of held-out views: as given by the data set; if it gives none at all, the pixels that change in
/// front of static cameras. Training never uses them. They are found with the default heuristics and not with a run's
/// `[cues]`, so that the same pixels are scored in every run on a data set.
pub fn regions(views: &[View]) -> Vec<Vec<Region>> {
    let given: Vec<Vec<Region>> = views.iter().map(given_regions).collect();
    if given.iter().any(|regions| !regions.is_empty()) {
        return given;
    }
    let masks = multiview::inferred_masks(views, &MaskOptions::default());
    let found = masks.iter().flatten().count();
    if found > 0 {
        tracing::info!(views = found, "moving parts of held-out views are measured where the photos change");
    }
    masks.into_iter().map(|mask| mask.map(|mask| Region { name: MOVING, mask }).into_iter().collect()).collect()
}

/// Highest order of a centre's path, with which its Gaussians' paths begin: at higher ones BIC fits the noise of
/// centres. The ends of a walking figure's recording lost 3 dB with order 12.
const CENTRE_ORDERS: usize = 6;

/// Infers the cues from the training views, once per run.
pub fn find_cues(scene: &Scene, config: &Config) -> Cues {
    let (motion, options) = (&config.method.motion, config.method.cues.options());
    let source = match motion.masks {
        MaskSource::Auto => multiview::MaskSource::Auto,
        MaskSource::Prior => multiview::MaskSource::Given,
        MaskSource::Evidence => multiview::MaskSource::Inferred,
        MaskSource::None => {
            let terms = without_basis(&MovingMasks::default(), &[], 0, config).into_iter().chain(absent(scene, config));
            return Cues { warnings: terms.collect(), ..Cues::default() };
        }
    };
    let masks = multiview::moving_masks(scene, source, &options.masks);
    let multiview::Centres { centres, notes } = multiview::centres(scene, &masks.masks);
    let scale = ImageScale::at(&scene.train, &centres);
    let tracks =
        multiview::tracks(scene, &masks.masks, &centres, motion.order_max.min(CENTRE_ORDERS), motion.kinks, &options);
    let guides = scene.train.iter().map(|view| {
        // The common centre of objects that move separately has none of their velocities.
        let velocity = multiview::guide_velocity(&centres, view.time?).filter(|_| tracks.len() < 2)?;
        Some(velocity.to_array())
    });
    let guides: Vec<Option<[f64; 3]>> = guides.collect();
    let terms = without_basis(&masks, &guides, tracks.len(), config).into_iter().chain(absent(scene, config));
    Cues {
        guides,
        warnings: masks.warnings.iter().cloned().chain(notes).chain(terms).collect(),
        tracks,
        scale,
        masks,
        centres,
    }
}

impl Cues {
    /// The centre's path, and the initial paths of Gaussians, for people.
    pub fn describe_path(&self, motion: &TaylorMotion) -> String {
        let Some(first) = self.tracks.first() else { return String::new() };
        let remainder = if motion.remainder.is_some() { " and a remainder" } else { "" };
        let kinks = self.tracks.iter().flat_map(|track| &track.path.kinks);
        let contacts: Vec<String> = kinks.map(|kink| format!("{:.3}", 0.5 * (kink.begin + kink.end))).collect();
        let whose = match self.tracks.len() {
            1 => "its centre is".into(),
            count => format!("{count} objects, the first one's centre is"),
        };
        let kinked =
            if contacts.is_empty() { String::new() } else { format!(" with a kink at {}", contacts.join(" and ")) };
        format!(
            "; {whose} {:.2} pixels (rms) from a path of order {}{kinked}, paths begin with order {}{remainder}",
            first.path.residual * self.scale.pixels_per_unit,
            first.path.order(),
            motion.order()
        )
    }

    /// The source of the masks, for people.
    pub fn describe_masks(&self) -> String {
        let count = |origin| self.masks.count(origin);
        match (count(MaskOrigin::Given), count(MaskOrigin::Inferred)) {
            (0, 0) => "no mask".into(),
            (given, 0) => format!("the data set's masks in {given} views"),
            (0, found) => format!("the pixels that change in front of static cameras in {found} views"),
            (given, found) => format!("the data set's masks in {given} views and the pixels that change in {found}"),
        }
    }
}

/// The time at which paths are expanded (the training time nearest the middle of the recording whose exposure has no
/// contact), and the half length for which every exposure lies within normalised times from -1 to 1.
pub fn window(scene: &Scene, exposure: f64, tracks: &[Track]) -> TimeWindow {
    let times: Vec<f64> = scene.train.iter().filter_map(|view| view.time).collect();
    let (low, high) = scene.time_range.unwrap_or((0.0, 0.0));
    let middle = 0.5 * (low + high);
    // The longest: cameras of one rig may differ.
    let longest = scene.train.iter().filter_map(|view| view.exposure).fold(exposure, f64::max);
    let shutter = 0.5 * longest;
    let undisturbed = |t: &f64| tracks.iter().all(|track| track.path.is_undisturbed(*t - shutter, *t + shutter));
    let nearest =
        |times: &mut dyn Iterator<Item = f64>| times.min_by(|a, b| (a - middle).abs().total_cmp(&(b - middle).abs()));
    let t0 = nearest(&mut times.iter().copied().filter(undisturbed))
        .or_else(|| nearest(&mut times.iter().copied()))
        .unwrap_or(middle);
    let half = (high - t0).max(t0 - low) + shutter;
    TimeWindow { t0, half: if half > 0.0 { half } else { 1.0 } }
}

/// The time between frames of one camera; `None` if there is a single time.
pub fn frame_interval(views: &[View]) -> Option<f64> {
    gs_datasets::frame_interval(views.iter().filter_map(|view| Some((view.camera_id.as_deref(), view.time?))))
}

/// The initial exposure: as configured, else as the data set states, else half a frame interval.
pub fn first_exposure(scene: &Scene, config: &Config) -> (f64, Option<String>) {
    let interval = frame_interval(&scene.train);
    if config.method.blur.exposure > 0.0 {
        let (set, longest) = (config.method.blur.exposure, interval.unwrap_or(f64::INFINITY));
        let warning = format!("blur.exposure: expected at most the time between two frames, {longest}, found {set}");
        return (set, (set > longest).then_some(warning));
    }
    if let Some(said) = stated_exposure(&scene.train) {
        return (said, None);
    }
    let half = 0.5 * interval.unwrap_or(1.0);
    (half, Some(format!("the data set does not say how long the shutter was open: beginning with {half:.4}")))
}

/// The exposure as the data set states it, in its unit of time; the median where views differ. One factor on all stated
/// exposures is learned.
pub fn stated_exposure(views: &[View]) -> Option<f64> {
    median(views.iter().filter_map(|view| view.exposure).filter(|e| *e > 0.0).collect())
}
