//! [`write()`]: moving objects in a textured room, filmed by static cameras with open shutters, with the truth beside
//! it.
//!
//! | file | holds |
//! |---|---|
//! | `scenes/deblur/*.toml` | the worlds; `room.toml` is common to all |
//! | `shake.rs` | the path of a camera during an exposure |
//! | `priors.rs` | depth, masks and pseudo-sharp images with faults |
//! | `write.rs` | cameras, exposures, the files of a photo |
//!
//! Rays, light and motion are those of `tracer/`. Nothing here is shared with the rasterizer that learns from these
//! images.

mod priors;
mod shake;
mod write;

#[cfg(test)]
mod tests;

pub use priors::{PriorFault, PriorFaults};
pub use write::write;

use crate::named::named;

named! {
    /// The worlds, the first four after those of the DynaMoDe-NeRF data set that TaylorMoDe-GS is measured on. Each has
    /// one moving object in a room with static objects; the last has two.
    pub enum World {
        /// A box slides and turns.
        Cube = "cube",
        /// A bumpy fruit spins.
        Lychee = "lychee",
        /// A head of several parts speeds up.
        Monkey = "monkey",
        /// A ball bounces.
        Sphere = "sphere",
        /// A box and a bumpy ball, each on its own way.
        Pair = "pair",
    }
}

impl World {
    fn description(self) -> &'static str {
        match self {
            Self::Cube => include_str!("../../scenes/deblur/cube.toml"),
            Self::Lychee => include_str!("../../scenes/deblur/lychee.toml"),
            Self::Monkey => include_str!("../../scenes/deblur/monkey.toml"),
            Self::Sphere => include_str!("../../scenes/deblur/sphere.toml"),
            Self::Pair => include_str!("../../scenes/deblur/pair.toml"),
        }
    }
}

/// Options of [`write()`].
#[derive(Debug, Clone, PartialEq)]
pub struct DeblurOptions {
    /// The world.
    pub world: World,
    /// Image width, 8 to 8192 pixels.
    pub width: usize,
    /// Image height, 8 to 8192 pixels.
    pub height: usize,
    /// Cameras, held-out ones included, 1 to 1000. They stand on an arc of 80 degrees in a room, or all around.
    pub cameras: usize,
    /// Cameras stand all around, in the open: no walls, the floor a disc, and a sky of which no photo says how far it
    /// is.
    pub ring: bool,
    /// Cameras that are held out; they stand between others, so at most `(cameras - 1) / 2`.
    pub held_out: usize,
    /// Frames of each camera, 1 to 10 000, at times `i / (frames - 1)`; a single one at 0.5.
    pub frames: usize,
    /// Instants that a blurry image is averaged from, 16 to 4096. Fewer than the pixels of motion per exposure leave
    /// steps in the blur.
    pub subframes: usize,
    /// How long the shutter is open, as a share of the time between frames, 0 to 2; 0 gives sharp photos, above 1
    /// the exposures overlap. For a single frame, of 1/15.
    pub exposure: f64,
    /// Multiplies all velocities; objects are at the same position at time 0.5. -10 to 10; 0 holds everything still.
    pub speed: f64,
    /// Typical length of the image's path while the shutter is open by which each photo to learn from has a path of its
    /// own, 0 to 100 pixels; 0: cameras stand still.
    pub shake: f64,
    /// How these paths differ.
    pub shakes: Shakes,
    /// Rolling shutter of the photos to learn from, if cameras shake: time from the first row's exposure to the last
    /// row's, in exposures, 0 to 20. The path is that of the whole frame.
    pub readout: f64,
    /// Points to start from, at most 10 million; 0 writes none.
    pub points: usize,
    /// Faults of the priors.
    pub priors: PriorFaults,
    /// Seed of all random draws: textures, static objects, cameras, points and faults. The same options write the same
    /// bytes.
    pub seed: u64,
}

/// Paths of cameras while their shutters are open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shakes {
    /// Each photo has its own turns and shifts.
    Own,
    /// Each photo has its own turns, and no shifts.
    Turns,
    /// All photos have one path, in the camera's axes.
    Common,
    /// Every tenth photo has its own, and the others none.
    Tenth,
}

impl Default for DeblurOptions {
    fn default() -> Self {
        Self {
            world: World::Cube,
            width: 256,
            height: 192,
            cameras: 10,
            ring: false,
            held_out: 1,
            frames: 16,
            subframes: 32,
            exposure: 0.9,
            speed: 1.0,
            shake: 0.0,
            shakes: Shakes::Own,
            readout: 0.0,
            points: 4000,
            priors: PriorFaults::default(),
            seed: 0,
        }
    }
}

/// The time between frames of a lone frame, which has no neighbour to measure from: that of the default 16.
const LONE_INTERVAL: f64 = 1.0 / 15.0;

impl DeblurOptions {
    /// How long the shutter is open, in the unit of time.
    pub fn exposure_time(&self) -> f64 {
        let interval = if self.frames > 1 { 1.0 / (self.frames - 1) as f64 } else { LONE_INTERVAL };
        self.exposure * interval
    }

    /// The time of frame `index`, the centre of its exposure.
    pub fn time(&self, index: usize) -> f64 {
        if self.frames > 1 { index as f64 / (self.frames - 1) as f64 } else { 0.5 }
    }
}
