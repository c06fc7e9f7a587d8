//! One mask of what moves per training view, given with the data or found in the photos.

use gs_datasets::{Scene, View, some_names};

use crate::cameras::static_cameras;
use crate::evidence::{FRAMES_MIN, evidence};
use crate::median::median;

/// When more than this share of the median view moves, something else is going on: a camera that is not fixed, light
/// that flickers, a mask the wrong way round.
const SUSPECT_SHARE: f64 = 0.6;

/// Noise beyond this, levels of 255, is none of a sensor in daylight: it is found where more than half of the picture
/// changes from frame to frame, and then little of it is called moving.
const NOISE_MAX: f32 = 12.0;

/// Where masks of moving pixels come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MaskSource {
    /// Only those of the data set ([`Priors::moving`](gs_datasets::Priors::moving)).
    Prior,
    /// Only those found in the photos of standing cameras; see [`evidence`].
    Evidence,
    /// The data set's where a view has one, found ones elsewhere.
    #[default]
    Auto,
}

/// Where one view's mask came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MaskOrigin {
    /// The data set.
    Prior,
    /// The photos.
    Evidence,
}

/// Masks of what moves in the training views.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MovingMasks {
    /// For each training view `[height, width]`: 255 where something moves, 0 elsewhere; `None` when not known.
    pub masks: Vec<Option<Vec<u8>>>,
    /// For each training view where its mask came from; `None` without one.
    pub from: Vec<Option<MaskOrigin>>,
    /// What is missing or suspicious, in sentences.
    pub warnings: Vec<String>,
}

impl MovingMasks {
    /// Nothing known of `count` views.
    fn unknown(count: usize) -> Self {
        Self { masks: vec![None; count], from: vec![None; count], warnings: Vec::new() }
    }

    /// How many views have a mask of this origin.
    pub fn count(&self, origin: MaskOrigin) -> usize {
        self.from.iter().filter(|from| **from == Some(origin)).count()
    }
}

/// Masks of what moves, one per training view where there is a way to know. Never fails: what is missing is `None` and
/// a warning.
pub fn moving_masks(scene: &Scene, source: MaskSource) -> MovingMasks {
    let views = &scene.train;
    let mut found = MovingMasks::unknown(views.len());
    if source != MaskSource::Evidence {
        take_priors(views, &mut found);
    }
    let missing = found.masks.iter().any(Option::is_none);
    if source == MaskSource::Prior && missing {
        let count = found.masks.iter().filter(|mask| mask.is_none()).count();
        found.warnings.push(format!("{count} of {} training views have no mask of moving objects", views.len()));
    } else if source != MaskSource::Prior && missing {
        take_evidence(views, &mut found);
    }
    check_shares(&mut found);
    found
}

/// Masks of what changes in front of each camera that stands still, from the photos of `views` alone; `None` where that
/// cannot be told.
pub fn changing(views: &[View]) -> Vec<Option<Vec<u8>>> {
    let mut found = MovingMasks::unknown(views.len());
    take_evidence(views, &mut found);
    found.masks
}

fn take_priors(views: &[View], found: &mut MovingMasks) {
    let mut misfits = 0;
    for (index, view) in views.iter().enumerate() {
        match &view.priors.moving {
            Some(mask) if mask.len() == view.width * view.height => {
                found.masks[index] = Some(mask.clone());
                found.from[index] = Some(MaskOrigin::Prior);
            }
            Some(_) => misfits += 1,
            None => {}
        }
    }
    if misfits > 0 {
        found.warnings.push(format!("masks of {misfits} training views have another size than the photo; left out"));
    }
}

fn take_evidence(views: &[View], found: &mut MovingMasks) {
    let (mut without, mut restless) = (Vec::new(), Vec::new());
    for camera in static_cameras(views) {
        if camera.views.iter().all(|index| found.masks[*index].is_some()) {
            continue;
        }
        let Some(evidence) = evidence(views, &camera) else {
            without.extend(camera.views.iter().filter(|index| found.masks[**index].is_none()).copied());
            continue;
        };
        if evidence.noise > NOISE_MAX {
            restless.push(camera.name);
        }
        for (index, mask) in camera.views.iter().zip(evidence.masks) {
            if found.masks[*index].is_none() {
                found.masks[*index] = Some(mask);
                found.from[*index] = Some(MaskOrigin::Evidence);
            }
        }
    }
    if !restless.is_empty() {
        found.warnings.push(format!(
            "more than half of the picture changes from frame to frame in {} cameras ({}), so little can be told about \
             what moves: are the cameras fixed, is the light steady?",
            restless.len(),
            some_names(&restless)
        ));
    }
    if !without.is_empty() {
        found.warnings.push(format!(
            "{} of {} training views have no mask of moving objects and none was found: it takes at least \
             {FRAMES_MIN} photos of one size from a camera that stands still",
            without.len(),
            views.len()
        ));
    }
}

/// Warns of masks in which nothing moves, or nearly everything.
fn check_shares(found: &mut MovingMasks) {
    let mut shares: Vec<f64> = found
        .masks
        .iter()
        .flatten()
        .map(|mask| mask.iter().filter(|value| **value != 0).count() as f64 / mask.len().max(1) as f64)
        .collect();
    let Some(median) = median(&mut shares, f64::total_cmp) else { return };
    if shares.iter().all(|share| *share == 0.0) {
        found.warnings.push("no mask has a moving pixel: nothing moves, or the masks are empty".to_string());
    } else if median > SUSPECT_SHARE {
        found.warnings.push(format!(
            "{:.0} % of the median view moves: are the cameras fixed, is the light steady, are masks the right way \
             round?",
            100.0 * median
        ));
    }
}
