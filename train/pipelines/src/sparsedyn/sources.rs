//! Where the Gaussians of the first frame begin.

use gs_datasets::{PointCloud, Scene, View};
use gs_multiview::{Pinhole, foreground_masks};

/// The source that tells where the Gaussians of the first frame begin.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Source {
    /// Depth priors of the first frame.
    Priors,
    /// The data set's points, where a photo of the first frame shows some.
    Points,
    /// The visual hull of outlines before a plain background.
    Hull,
    /// The photos alone.
    #[default]
    Photos,
}

impl Source {
    /// Of a scene whose first frame is the training views `first`; `has_priors`: whether some of these have a usable
    /// depth prior.
    pub fn of(scene: &Scene, first: &[usize], has_priors: bool) -> Self {
        if has_priors {
            return Self::Priors;
        }
        let views: Vec<View> = first.iter().map(|index| scene.train[*index].clone()).collect();
        if scene.points.as_ref().is_some_and(|points| are_in_view(points, &views)) {
            return Self::Points;
        }
        if foreground_masks(&views).is_some() { Self::Hull } else { Self::Photos }
    }
}

/// Whether at least one of `views` shows any of the points.
pub fn are_in_view(points: &PointCloud, views: &[View]) -> bool {
    let cameras: Vec<Pinhole> = views.iter().map(Pinhole::new).collect();
    let is_shown = |position: &[f32; 3]| {
        let position = glam::Vec3::from(*position).as_dvec3();
        cameras.iter().any(|camera| camera.sees(position).is_some())
    };
    points.positions.iter().any(is_shown)
}
