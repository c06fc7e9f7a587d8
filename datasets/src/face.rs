//! One pinhole view of a wide photo: [`Face`].

use glam::DMat3;
use gs_base::Intrinsics;

/// Most pixels along a side of a view for each of the photo's longer side: a calibration that diverged asks for any
/// number of them.
const ENLARGED_MAX: f64 = 2.0;

/// A pinhole view of a photo.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Face {
    /// Comes behind the photo's name; empty for the only view of a photo.
    pub ending: &'static str,
    /// From the view's camera axes to the photo's.
    pub rotation: DMat3,
    pub intrinsics: Intrinsics,
    /// Width and height, pixels.
    pub size: (usize, usize),
}

/// A rectangle at distance 1 before a camera: left and right, top and bottom.
pub(crate) type Window = [(f64, f64); 2];

impl Face {
    /// The view of a window, with a focal length of about `focal` pixels; `longest` is the photo's longer side, pixels.
    pub fn of(ending: &'static str, rotation: DMat3, window: Window, focal: f64, longest: f64) -> Self {
        let [width, height] = window.map(|(low, high)| high - low);
        let focal = focal.min(ENLARGED_MAX * longest / width.max(height));
        let side = |length: f64| (focal * length).round().max(1.0);
        let (columns, rows) = (side(width), side(height));
        // Whole pixels fill the window.
        let (fx, fy) = (columns / width, rows / height);
        let intrinsics = Intrinsics { fx, fy, cx: -fx * window[0].0, cy: -fy * window[1].0 };
        Self { ending, rotation, intrinsics, size: (columns as usize, rows as usize) }
    }

    /// The horizontal angle of view, degrees.
    pub fn across(&self) -> f64 {
        let Intrinsics { fx, cx, .. } = self.intrinsics;
        ((cx / fx).atan() + ((self.size.0 as f64 - cx) / fx).atan()).to_degrees()
    }
}
