//! One mask of moving pixels per training view: given by the data set or inferred from the photos.

use gs_base::statistics::median_by;
use gs_base::{agree, counted};
use gs_datasets::{Scene, View, some_names};

use crate::camera_masks::{FRAMES_MIN, camera_masks};
use crate::cameras::static_cameras;
use crate::options::MaskOptions;

/// Share of moving pixels in the median view above which the input is suspect: a camera that moves, light that
/// flickers, an inverted mask.
const SUSPECT_SHARE: f64 = 0.6;

/// Noise above this, levels of 255, is no sensor's in daylight. It is estimated where more than half of the picture
/// changes between frames, and then masks miss most motion.
const NOISE_MAX: f32 = 12.0;

/// Source of the masks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MaskSource {
    /// Masks of the data set alone ([`Priors::moving`](gs_datasets::Priors::moving)).
    Given,
    /// Masks inferred from the photos of static cameras alone; see [`camera_masks`](fn@crate::camera_masks).
    Inferred,
    /// The data set's mask where a view has one, an inferred one elsewhere.
    #[default]
    Auto,
}

/// Origin of one view's mask.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MaskOrigin {
    /// Given by the data set.
    Given,
    /// Inferred from the photos.
    Inferred,
}

/// Masks of moving pixels in the training views.
///
/// Inferred masks live here and nowhere else: [`Priors::moving`](gs_datasets::Priors::moving) holds masks that the
/// data set gave, and nothing may write an inferred one there. Later code could not tell them apart, and an
/// evaluation would take a guess for the truth.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MovingMasks {
    /// For each training view `[height, width]`: 255 where something moves, 0 elsewhere; `None` when not known.
    pub masks: Vec<Option<Vec<u8>>>,
    /// Origin of each training view's mask; `None` without one.
    pub origins: Vec<Option<MaskOrigin>>,
    /// Warnings about missing or suspicious masks, one sentence each.
    pub warnings: Vec<String>,
}

impl MovingMasks {
    /// No mask for any of `count` views.
    fn unknown(count: usize) -> Self {
        Self { masks: vec![None; count], origins: vec![None; count], warnings: Vec::new() }
    }

    /// Number of views whose mask has this origin.
    pub fn count(&self, origin: MaskOrigin) -> usize {
        self.origins.iter().filter(|one| **one == Some(origin)).count()
    }
}

/// One mask per training view. Never fails: a view without a mask has `None`, and a warning says so. The scene is not
/// changed.
pub fn moving_masks(scene: &Scene, source: MaskSource, options: &MaskOptions) -> MovingMasks {
    let views = &scene.train;
    let mut found = MovingMasks::unknown(views.len());
    if source != MaskSource::Inferred {
        take_given(views, &mut found);
    }
    let missing = found.masks.iter().any(Option::is_none);
    if source == MaskSource::Given && missing {
        let count = found.masks.iter().filter(|mask| mask.is_none()).count();
        found.warnings.push(format!(
            "{count} of {} {} no mask of moving objects",
            counted(views.len(), "training view"),
            agree(count, "has", "have")
        ));
    } else if source != MaskSource::Given && missing {
        infer(views, options, &mut found);
    }
    check_shares(&mut found);
    found
}

/// Inferred masks of `views`, for each static camera among them, from their photos alone; `None` for a view whose
/// camera moves or has too few views. For held-out views: the result says where photos change, it is no truth.
pub fn inferred_masks(views: &[View], options: &MaskOptions) -> Vec<Option<Vec<u8>>> {
    let mut found = MovingMasks::unknown(views.len());
    infer(views, options, &mut found);
    found.masks
}

fn take_given(views: &[View], found: &mut MovingMasks) {
    let mut misfits = 0;
    for (index, view) in views.iter().enumerate() {
        match &view.priors.moving {
            Some(mask) if mask.len() == view.width * view.height => {
                found.masks[index] = Some(mask.clone());
                found.origins[index] = Some(MaskOrigin::Given);
            }
            Some(_) => misfits += 1,
            None => {}
        }
    }
    if misfits > 0 {
        found
            .warnings
            .push(format!("masks of {} have another size than the photo; left out", counted(misfits, "training view")));
    }
}

fn infer(views: &[View], options: &MaskOptions, found: &mut MovingMasks) {
    let (mut without, mut noisy) = (Vec::new(), Vec::new());
    for camera in static_cameras(views) {
        if camera.views.iter().all(|index| found.masks[*index].is_some()) {
            continue;
        }
        let Some(inferred) = camera_masks(views, &camera, options) else {
            without.extend(camera.views.iter().filter(|index| found.masks[**index].is_none()).copied());
            continue;
        };
        if inferred.noise > NOISE_MAX {
            noisy.push(camera.name);
        }
        for (index, mask) in camera.views.iter().zip(inferred.masks) {
            if found.masks[*index].is_none() {
                found.masks[*index] = Some(mask);
                found.origins[*index] = Some(MaskOrigin::Inferred);
            }
        }
    }
    if !noisy.is_empty() {
        found.warnings.push(format!(
            "more than half of the picture changes from frame to frame in {} ({}), so masks miss most \
             motion: are the cameras fixed, is the light steady?",
            counted(noisy.len(), "camera"),
            some_names(&noisy)
        ));
    }
    if !without.is_empty() {
        found.warnings.push(format!(
            "{} of {} {} no mask of moving objects and none could be inferred: that takes at least {FRAMES_MIN} \
             photos of one size from a static camera",
            without.len(),
            counted(views.len(), "training view"),
            agree(without.len(), "has", "have")
        ));
    }
}

/// Warns of masks without a moving pixel and of masks of nearly the whole image.
fn check_shares(found: &mut MovingMasks) {
    let mut shares: Vec<f64> = found
        .masks
        .iter()
        .flatten()
        .map(|mask| mask.iter().filter(|value| **value != 0).count() as f64 / mask.len().max(1) as f64)
        .collect();
    let Some(median) = median_by(&mut shares, f64::total_cmp) else { return };
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
