//! An image on the host with its camera, and the points that it shows.

use glam::{DMat4, DVec2};
use gs_datasets::RgbImage8;
use gs_driving::{Camera, DrivingLog, project, sample};

/// An image with its camera.
#[derive(Debug, Clone)]
pub struct HostView {
    /// Camera and frame.
    pub name: String,
    /// Place in the log's list of frames.
    pub frame: usize,
    /// Place in the log's list of cameras.
    pub camera: usize,
    /// Camera to the snippet's axes, OpenCV axes.
    pub c2w: DMat4,
    /// Seconds.
    pub seconds: f64,
    /// 0 to 1 in the window; beyond 1 in the future.
    pub time: f64,
    /// The image, without rows that show the vehicle itself.
    pub image: RgbImage8,
    /// Depth of the frame's LiDAR, `[height, width]`, metres, 0 where there is none.
    pub depth: Vec<f32>,
}

/// The inverse of a rigid motion, exact where a general one would round.
pub fn inverse(c2w: DMat4) -> DMat4 {
    let rotation = glam::DMat3::from_mat4(c2w).transpose();
    let translation = -(rotation * c2w.w_axis.truncate());
    DMat4::from_cols(
        rotation.x_axis.extend(0.0),
        rotation.y_axis.extend(0.0),
        rotation.z_axis.extend(0.0),
        translation.extend(1.0),
    )
}

/// A view with its camera and its pose inverted once, for many points.
pub struct Posed<'a> {
    /// The view.
    pub view: &'a HostView,
    camera: &'a Camera,
    w2c: DMat4,
}

impl<'a> Posed<'a> {
    /// A view of a log.
    pub fn new(log: &'a DrivingLog, view: &'a HostView) -> Self {
        Self { view, camera: &log.cameras()[view.camera], w2c: inverse(view.c2w) }
    }

    /// Views of a log.
    pub fn all(log: &'a DrivingLog, views: &'a [HostView]) -> Vec<Self> {
        views.iter().map(|view| Self::new(log, view)).collect()
    }

    /// The place of a point (in the axes of the snippet) in the image, pixels, and its depth, metres; `None` outside of
    /// it.
    pub fn place(&self, point: [f32; 3]) -> Option<(DVec2, f64)> {
        project(self.camera, &self.w2c, point)
    }
}

/// The colour of a point in the view in which it is nearest to the middle.
pub fn color_at<'a>(views: impl Iterator<Item = &'a Posed<'a>>, point: [f32; 3]) -> Option<[f32; 3]> {
    let seen = views.filter_map(|posed| {
        let (pixel, _) = posed.place(point)?;
        Some(((pixel.x / posed.view.image.width as f64 - 0.5).abs(), pixel, posed.view))
    });
    let (_, pixel, view) = seen.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(sample(&view.image, pixel))
}
