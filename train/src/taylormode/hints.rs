//! What the photos say about motion before anything is learned: masks, the path of the moving object's centre, the
//! recording's middle and length, the exposure.

use gs_datasets::motion::{self, Centre, MaskOrigin, MovingMasks};
use gs_datasets::{Scene, View};
use gs_models::taylormode::TimeWindow;

use crate::experiment::{Config, Pipeline};
use crate::taylormode::config::{BlurMode, MaskSource};
use crate::taylormode::state::MotionState;
use crate::taylormode::tracks::{Track, pixels_per_unit, tracks};

/// What was found.
#[derive(Debug, Clone, Default)]
pub struct Found {
    /// Per training view: the moving pixels, and where they are from; empty where nothing was looked for.
    pub masks: MovingMasks,
    /// Per training view: world velocity of the centre of what moves, scene units per unit of time; empty likewise.
    pub guides: Vec<Option<[f64; 3]>>,
    /// The centre of what moves, by time.
    pub centres: Vec<Centre>,
    /// What moves apart from the rest, each with its path; none without centres at two times.
    pub tracks: Vec<Track>,
    /// Pixels that one scene unit spans at the centre, mean over the training views; 0 without centres.
    pub pixels_per_unit: f64,
    /// What was left out, in sentences.
    pub warnings: Vec<String>,
}

/// Priors that terms of the loss ask for and no training view has, in sentences.
fn absent(scene: &Scene, config: &Config) -> Vec<String> {
    let has = |found: fn(&View) -> bool| scene.train.iter().any(found);
    let mut said = Vec::new();
    if config.prior.depth > 0.0 && !has(|view| view.priors.depth.is_some()) {
        said.push("no depth priors: the depth term (Eq. 16) is left out".into());
    }
    if config.prior.pseudo && config.prior.sharp > 0.0 && !has(|view| view.priors.sharp.is_some()) {
        said.push("no pseudo-sharp photos (Eq. 13): training has the blurry ones alone".into());
    }
    said
}

/// Terms of the warp that what was found leaves without a basis, in sentences.
fn without_basis(masks: &MovingMasks, guides: &[Option<[f64; 3]>], bodies: usize, config: &Config) -> Vec<String> {
    if config.blur.mode != BlurMode::Warp {
        return Vec::new();
    }
    let mut said = Vec::new();
    if masks.masks.iter().all(Option::is_none) {
        said.push(
            "no masks: the blurred term (Eq. 15) counts all pixels, and no background is protected from it".into(),
        );
    }
    if config.prior.velocity > 0.0 && guides.iter().all(Option::is_none) {
        let why = if bodies > 1 { "bodies move apart" } else { "no path of an object's centre" };
        said.push(format!("{why}: the guide velocity (Eq. 17) is left out"));
    }
    said
}

/// Leaves out photos that have no time although others do: nobody knows what they show.
pub fn leave_out_timeless(scene: &mut Scene) {
    let count = |scene: &Scene| scene.train.len() + scene.test.len();
    let before = count(scene);
    if scene.time_range.is_some() {
        scene.train.retain(|view| view.time.is_some());
        scene.test.retain(|view| view.time.is_some());
    }
    let left_out = before - count(scene);
    if let Some(warning) = left_out_warning(left_out) {
        tracing::warn!("{warning}");
        scene.warnings.push(warning);
    }
}

/// The sentence about photos without a time, where there are any.
pub fn left_out_warning(photos: usize) -> Option<String> {
    (photos > 0).then(|| format!("{photos} photos without a time are left out"))
}

/// Gives held-out views of standing cameras masks of what changes in front of them, where the data set has masks for none of them:
/// moving parts can be measured then. Training never sees them.
pub fn mask_held_out(scene: &mut Scene) {
    if scene.test.iter().any(|view| view.truth.moving.is_some() || view.priors.moving.is_some()) {
        return;
    }
    let masks = motion::changing(&scene.test);
    let found = masks.iter().flatten().count();
    if found > 0 {
        tracing::info!(views = found, "moving parts of held-out views are measured where the photos change");
    }
    for (view, mask) in scene.test.iter_mut().zip(masks) {
        view.priors.moving = mask;
    }
}

/// Looks at the training views, once for a run; `None` in a pipeline in which nothing moves.
pub fn gather(scene: &Scene, config: &Config) -> Option<Found> {
    if config.pipeline == Pipeline::Static {
        return None;
    }
    let source = match config.motion.masks {
        MaskSource::Auto => motion::MaskSource::Auto,
        MaskSource::Prior => motion::MaskSource::Prior,
        MaskSource::Evidence => motion::MaskSource::Evidence,
        MaskSource::None => {
            let terms = without_basis(&MovingMasks::default(), &[], 0, config).into_iter().chain(absent(scene, config));
            return Some(Found { warnings: terms.collect(), ..Found::default() });
        }
    };
    let masks = motion::moving_masks(scene, source);
    let motion::Centres { centres, notes } = motion::centres(scene, &masks.masks);
    let pixels_per_unit = pixels_per_unit(scene, &centres);
    let tracks = tracks(scene, &masks, &centres, pixels_per_unit, config);
    let guides = scene.train.iter().map(|view| {
        // The centre of bodies that move apart moves like none of them.
        let velocity = motion::guide_velocity(&centres, view.time?).filter(|_| tracks.len() < 2)?;
        Some(velocity.to_array())
    });
    let guides: Vec<Option<[f64; 3]>> = guides.collect();
    let terms = without_basis(&masks, &guides, tracks.len(), config).into_iter().chain(absent(scene, config));
    Some(Found {
        guides,
        warnings: masks.warnings.iter().cloned().chain(notes).chain(terms).collect(),
        tracks,
        pixels_per_unit,
        masks,
        centres,
    })
}

impl Found {
    /// What is known of the centre's path, and what paths begin with, in words.
    pub fn path_in_words(&self, state: &MotionState) -> String {
        let Some(first) = self.tracks.first() else { return String::new() };
        let remainder = if state.remainder.is_some() { " and a remainder" } else { "" };
        let kinks = self.tracks.iter().flat_map(|track| &track.path.kinks);
        let hits: Vec<String> = kinks.map(|kink| format!("{:.3}", 0.5 * (kink.begin + kink.end))).collect();
        let whose = match self.tracks.len() {
            1 => "its centre is".into(),
            count => format!("{count} bodies, the first one's centre is"),
        };
        let hit = if hits.is_empty() { String::new() } else { format!(" with a kink at {}", hits.join(" and ")) };
        format!(
            "; {whose} {:.2} pixels (rms) from a path of order {}{hit}, paths begin with order {}{remainder}",
            first.path.residual * self.pixels_per_unit,
            first.path.order(),
            state.order()
        )
    }

    /// Where the masks are from, in words.
    pub fn origin(&self) -> String {
        let count = |origin| self.masks.count(origin);
        match (count(MaskOrigin::Prior), count(MaskOrigin::Evidence)) {
            (0, 0) => "no mask".into(),
            (given, 0) => format!("the data set's masks in {given} views"),
            (0, found) => format!("what changes in front of standing cameras in {found} views"),
            (given, found) => format!("the data set's masks in {given} views and what changes in {found}"),
        }
    }
}

/// The time paths are expanded at (the training time nearest the middle of the recording at which nothing is hit while the
/// shutter is open), and the half length that makes every exposure lie within normalised times from -1 to 1.
pub fn window(scene: &Scene, exposure: f64, tracks: &[Track]) -> TimeWindow {
    let times: Vec<f64> = scene.train.iter().filter_map(|view| view.time).collect();
    let (low, high) = scene.time_range.unwrap_or((0.0, 0.0));
    let middle = 0.5 * (low + high);
    let shutter = 0.5 * exposure;
    let undisturbed = |t: &f64| tracks.iter().all(|track| track.path.is_undisturbed(*t - shutter, *t + shutter));
    let nearest =
        |times: &mut dyn Iterator<Item = f64>| times.min_by(|a, b| (a - middle).abs().total_cmp(&(b - middle).abs()));
    let t0 = nearest(&mut times.iter().copied().filter(undisturbed))
        .or_else(|| nearest(&mut times.iter().copied()))
        .unwrap_or(middle);
    let half = (high - t0).max(t0 - low) + 0.5 * exposure;
    TimeWindow { t0, half: if half > 0.0 { half } else { 1.0 } }
}

/// The time between frames of one camera; `None` when there is one time only.
pub fn frame_interval(views: &[View]) -> Option<f64> {
    gs_datasets::frame_interval(views.iter().filter_map(|view| Some((view.camera_id.as_deref(), view.time?))))
}

/// The exposure a run begins with: as configured, else as the data set says, else half a frame interval.
pub fn first_exposure(scene: &Scene, config: &Config) -> (f64, Option<String>) {
    let interval = frame_interval(&scene.train);
    if config.blur.exposure > 0.0 {
        let (set, longest) = (config.blur.exposure, interval.unwrap_or(f64::INFINITY));
        let warning = format!("blur.exposure: expected at most the time between two frames, {longest}, found {set}");
        return (set, (set > longest).then_some(warning));
    }
    if let Some(said) = said_exposure(&scene.train) {
        return (said, None);
    }
    let half = 0.5 * interval.unwrap_or(1.0);
    (half, Some(format!("the data set does not say how long the shutter was open: beginning with {half:.4}")))
}

/// How long the shutter was open, as the data set says: one number is learned for all views, so where they differ the median is
/// what it is compared with too.
pub fn said_exposure(views: &[View]) -> Option<f64> {
    let mut said: Vec<f64> = views.iter().filter_map(|view| view.exposure).filter(|e| *e > 0.0).collect();
    said.sort_by(f64::total_cmp);
    said.get(said.len() / 2).copied()
}
