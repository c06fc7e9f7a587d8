//! Checks of a data set against a configuration, shared by `check` and training.

use std::path::Path;

use gs_base::counted;
use gs_datasets::{DatasetError, Decoded, LoadOptions, Log, PointCloud, PoseConvention, Scene, Split, View, surveyed};
use gs_multiview::{Camera, PoseJudgement, judge_poses, pose_pairs};
use rayon::prelude::*;

/// Largest `render.near`, in distances of the subject. Beyond half of that distance little is left to draw. A near
/// plane that cuts away the walls of a rig comes close to it (Panoptic: 1.2 of about 2.7 m).
pub const NEAR_MOST: f64 = 0.5;

/// Advised `render.near`, and its value if left open, in distances of the subject: no photo is taken of anything that
/// near.
pub const NEAR_ADVISED: f64 = 0.01;

/// Checks that at least one training pixel counts.
///
/// # Errors
/// A sentence, if masks or lens distortion remove every pixel of every training view.
pub fn check_pixels(dataset: &Path, scene: &Scene) -> Result<(), String> {
    let counts = |view: &View| view.mask.as_ref().is_none_or(|mask| mask.iter().any(|keep| *keep != 0));
    if surveyed(&scene.train).iter().any(counts) {
        return Ok(());
    }
    Err(no_pixels(dataset))
}

/// Fewest points to start from. A set with fewer is one whose reconstruction failed, and starts as a set without points
/// does.
const FEWEST_POINTS: usize = 100;

/// A warning about so few points that they are left out.
pub fn few_points(count: usize) -> Option<String> {
    (1..FEWEST_POINTS).contains(&count).then(|| {
        format!(
            "{} to start from, fewer than {FEWEST_POINTS}: left out, and Gaussians begin where photos agree and at random, as in a set \
             without points (init.random_points of them)",
            counted(count, "point")
        )
    })
}

/// Leaves out points of which there are so few, with a warning.
pub fn leave_out_few_points(points: &mut Option<PointCloud>) -> Option<String> {
    let warning = few_points(points.as_ref()?.len())?;
    *points = None;
    Some(warning)
}

/// The sentence about photos in which no pixel counts.
pub fn no_pixels(dataset: &Path) -> String {
    format!(
        "{}: expected photos with pixels that count, found none by masks or lens distortion; data.masks says how masks are read",
        dataset.display()
    )
}

/// Poses judged by the photos and points of a scene.
pub fn judge_scene(scene: &Scene) -> PoseJudgement {
    let cameras: Vec<Camera> = scene.train.iter().map(|view| Camera { c2w: view.c2w, time: view.time }).collect();
    let chosen = pose_pairs(&cameras);
    // Views whose photos are decoded when they are asked for are looked at as `judge_dataset` does.
    let narrow = |view: &View| view.source.is_some().then(|| view.reduced(JUDGED_WIDTH));
    let narrow: Vec<Option<View>> = chosen.views.iter().map(|view| narrow(&scene.train[*view])).collect();
    let views: Vec<Decoded> = chosen
        .views
        .par_iter()
        .zip(&narrow)
        .map(|(view, narrow)| narrow.as_ref().unwrap_or(&scene.train[*view]).decoded())
        .collect();
    let views: Vec<&View> = views.iter().map(|view| &**view).collect();
    judge_poses(&views, &chosen.pairs, scene.points.as_ref(), scene.origin, scene.poses)
}

/// Width of the photos by which [`judge_dataset`] judges, pixels: twice that at which corners are matched.
const JUDGED_WIDTH: usize = 640;

/// [`judge_scene`] of a data set of which only the few photos that are looked at are decoded.
///
/// # Errors
/// When the data set does not load.
pub fn judge_dataset(dataset: &Path, options: &LoadOptions) -> Result<PoseJudgement, DatasetError> {
    let width = options.max_width.unwrap_or(JUDGED_WIDTH).min(JUDGED_WIDTH);
    let log = Log::describe_quietly(dataset, &LoadOptions { max_width: Some(width), ..options.clone() })?;
    let trains = log.splits().find(|(name, _)| *name == Split::TRAIN).map_or(0..0, |(_, range)| range);
    let cameras: Vec<Camera> =
        log.frames()[trains].iter().map(|frame| Camera { c2w: frame.c2w, time: frame.time }).collect();
    let chosen = pose_pairs(&cameras);
    // Training frames come first.
    let views: Vec<View> = chosen.views.iter().map(|view| log.decode(*view)).collect::<Result<_, _>>()?;
    let read = options.poses.unwrap_or_else(|| PoseConvention::of(log.format()));
    Ok(judge_poses(&views.iter().collect::<Vec<_>>(), &chosen.pairs, log.points(), log.origin(), read))
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
