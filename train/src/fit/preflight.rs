//! Checks of a data set against a configuration, shared by `check` and training.

use std::path::Path;

use gs_datasets::{Scene, View};

/// Largest `render.near`, in distances of the subject. Beyond half of that distance little is left to draw. A near plane that cuts
/// away the walls of a rig comes close to it (Panoptic: 1.2 of about 2.7 m).
pub const NEAR_MOST: f64 = 0.5;

/// Advised `render.near`, and its value if left open, in distances of the subject: no photo is taken of anything that near.
pub const NEAR_ADVISED: f64 = 0.01;

/// Checks that at least one training pixel counts.
///
/// # Errors
/// A sentence, if masks or lens distortion remove every pixel of every training view.
pub fn check_pixels(dataset: &Path, scene: &Scene) -> Result<(), String> {
    let counts = |view: &View| view.mask.as_ref().is_none_or(|mask| mask.iter().any(|keep| *keep != 0));
    if scene.train.iter().any(counts) {
        return Ok(());
    }
    Err(no_pixels(dataset))
}

/// The sentence about photos in which no pixel counts.
pub fn no_pixels(dataset: &Path) -> String {
    format!(
        "{}: expected photos with pixels that count, found none by masks or lens distortion; data.masks says how masks are read",
        dataset.display()
    )
}

/// A warning if nearly everything is nearer than the near plane. `distance` is
/// [`Scene::subject_distance`](gs_datasets::Scene::subject_distance).
pub fn near_warning(near: f64, distance: Option<f64>) -> Option<String> {
    let distance = distance.filter(|distance| near > NEAR_MOST * distance)?;
    Some(format!(
        "render.near is {near}, but the cameras stand {distance:.2e} scene units (median) from what they look at: little or nothing is \
         drawn; set render.near={:.0e}, or scale the data set",
        NEAR_ADVISED * distance
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_is_compared_with_the_subject() {
        assert_eq!(near_warning(0.01, None), None);
        assert_eq!(near_warning(0.01, Some(0.03)), None);
        let warning = near_warning(0.01, Some(0.004)).expect("nothing is drawn");
        assert!(warning.contains("render.near=4e-5"), "{warning}");
        assert_eq!(near_warning(4e-5, Some(0.004)), None);
    }
}
