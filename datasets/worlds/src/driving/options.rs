//! [`StreetOptions`].

use std::path::Path;

use gs_datasets::DatasetError;

use crate::ranges::check_ranges;

/// Bodies that a street has beside its movers, whose paths meet during the first second.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Encounter {
    /// None.
    #[default]
    None,
    /// A car that drives ahead at 9 m/s, two lanes to the left of the ego vehicle.
    Car,
    /// The same car behind an oncoming bus of 6 m, which hides it for about half a second.
    HiddenCar,
}

/// How a log of a synthetic street is made. The same options write the same bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct StreetOptions {
    /// Frames at 10 Hz, 1 to 300.
    pub frames: usize,
    /// Cameras, 1 to 6, in the order front, front left, front right, left, right, back.
    pub cameras: usize,
    /// Image width, 16 to 4096 pixels.
    pub width: usize,
    /// Image height, 16 to 4096 pixels.
    pub height: usize,
    /// Beams of the LiDAR, 1 to 128.
    pub beams: usize,
    /// Directions in one turn of the LiDAR, 36 to 3600.
    pub columns: usize,
    /// LiDARs, 1 or 2; the second one stands ahead of the first and below it and looks the other way.
    pub lidars: usize,
    /// Rays along each side of a pixel, 1 to 4.
    pub subpixels: usize,
    /// Vehicles, cyclists and people that move, 0 to 60.
    pub movers: usize,
    /// Bodies that pass beside the movers.
    pub encounter: Encounter,
    /// Seed of the street, the traffic and the noise.
    pub seed: u64,
    /// Standard deviation of the LiDAR's ranges, 0 to 1 m.
    pub range_noise: f64,
    /// Error of the times that are written for images, -1 to 1 s: the image was taken this much later than its poses
    /// and times say.
    pub camera_delay: f64,
    /// Standard deviation of the positions of written camera poses, 0 to 5 m, and of their angles, in hundredths of a
    /// radian.
    pub pose_noise: f64,
    /// Whether pickles are compressed (`.pkl.gz`), as in the original, or not (`.pkl`), as in the re-packed data set.
    pub compressed: bool,
    /// Whether depth, flow and instances are written for images.
    pub truth_images: bool,
}

impl Default for StreetOptions {
    fn default() -> Self {
        Self {
            frames: 40,
            cameras: 3,
            width: 320,
            height: 180,
            beams: 32,
            columns: 900,
            lidars: 1,
            subpixels: 2,
            movers: 16,
            encounter: Encounter::None,
            seed: 0,
            range_noise: 0.02,
            camera_delay: 0.0,
            pose_noise: 0.0,
            compressed: true,
            truth_images: true,
        }
    }
}

impl StreetOptions {
    /// Fails unless every option is in its range.
    pub(super) fn check(&self, path: &Path) -> Result<(), DatasetError> {
        let counts = [
            ("frames", self.frames, 1..=300),
            ("cameras", self.cameras, 1..=6),
            ("width", self.width, 16..=4096),
            ("height", self.height, 16..=4096),
            ("beams", self.beams, 1..=128),
            ("columns", self.columns, 36..=3600),
            ("lidars", self.lidars, 1..=2),
            ("subpixels", self.subpixels, 1..=4),
            ("movers", self.movers, 0..=60),
        ];
        check_ranges(path, &counts)?;
        let measures = [
            ("range_noise", self.range_noise, 0.0..=1.0),
            ("camera_delay", self.camera_delay, -1.0..=1.0),
            ("pose_noise", self.pose_noise, 0.0..=5.0),
        ];
        check_ranges(path, &measures)
    }
}
