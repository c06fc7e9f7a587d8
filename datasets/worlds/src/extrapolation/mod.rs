//! [`write()`]: rigid objects with steady laws of motion, filmed by static cameras, of which the last quarter is to be
//! predicted.
//!
//! The worlds are in the manner of NVFi's Dynamic Objects and Dynamic Indoor Scenes: 60 frames over one unit of time,
//! of which those up to [`LAST_TRAINING_TIME`] are for training.
//!
//! | file | holds |
//! |---|---|
//! | `scenes/extrapolation/*.toml` | the worlds; `light.toml` is common to all but the room |
//! | `random.rs` | bodies and laws that the seed draws |
//! | `priors.rs` | depth and confidence with the errors of a feed-forward reconstructor |
//! | `write.rs` | cameras, the files of a photo, the points that the priors place |
//!
//! Rays, light and motion are those of `tracer/`. Nothing here is shared with the rasterizer that learns from these
//! images.

mod priors;
mod random;
mod write;

#[cfg(test)]
mod tests;

pub use priors::PriorErrors;
pub use random::Planted;
pub use write::{planted, write};

use crate::named::named;

/// Frames up to this time are for training; NVFi's split.
pub const LAST_TRAINING_TIME: f64 = 0.75;

named! {
    /// The worlds. All but the last are objects before a transparent background.
    pub enum World {
        /// A rotor turns steadily on a stand.
        Fan = "fan",
        /// A ball falls freely beside a still object.
        FallingBall = "falling-ball",
        /// A box slides past a still object and slows down.
        Slider = "slider",
        /// A bob on a rod swings in a frame.
        Pendulum = "pendulum",
        /// The lid of a box opens ever faster.
        Hinge = "hinge",
        /// Three nested bodies move apart at steady velocities.
        Telescope = "telescope",
        /// A lopsided body turns ever faster.
        Spinner = "spinner",
        /// A thrown ball, and a box that drifts and turns.
        Duo = "duo",
        /// One to three bodies whose shapes and laws of motion the seed draws.
        Random = "random",
        /// A room with a sliding box, a spinning top, a pendulum and a rising box.
        Room = "room",
    }
}

impl World {
    fn description(self) -> &'static str {
        match self {
            Self::Fan => include_str!("../../scenes/extrapolation/fan.toml"),
            Self::FallingBall => include_str!("../../scenes/extrapolation/falling-ball.toml"),
            Self::Slider => include_str!("../../scenes/extrapolation/slider.toml"),
            Self::Pendulum => include_str!("../../scenes/extrapolation/pendulum.toml"),
            Self::Hinge => include_str!("../../scenes/extrapolation/hinge.toml"),
            Self::Telescope => include_str!("../../scenes/extrapolation/telescope.toml"),
            Self::Spinner => include_str!("../../scenes/extrapolation/spinner.toml"),
            Self::Duo => include_str!("../../scenes/extrapolation/duo.toml"),
            Self::Random => include_str!("../../scenes/extrapolation/random.toml"),
            Self::Room => include_str!("../../scenes/extrapolation/room.toml"),
        }
    }

    /// Whether the world is a room. The others are objects before a transparent background.
    pub fn is_room(self) -> bool {
        self == Self::Room
    }

    /// Cameras, held-out ones included, and held-out cameras of NVFi's sets of this kind.
    pub fn usual_cameras(self) -> (usize, usize) {
        if self.is_room() { (25, 5) } else { (15, 3) }
    }
}

/// Options of [`write()`].
#[derive(Debug, Clone, PartialEq)]
pub struct ExtrapolationOptions {
    /// The world.
    pub world: World,
    /// Image width, 8 to 8192 pixels.
    pub width: usize,
    /// Image height, 8 to 8192 pixels.
    pub height: usize,
    /// Cameras, held-out ones included, 1 to 1000. They stand all around: on a dome outside of objects, under the
    /// ceiling of a room.
    pub cameras: usize,
    /// Cameras that are held out, at most `(cameras - 1) / 2`.
    pub held_out: usize,
    /// Frames of each camera, 8 to 10 000, at times `i / frames`.
    pub frames: usize,
    /// Depth and velocity are written of every so many frames and of the last, 1 to 10 000.
    pub truth_every: usize,
    /// Errors of the priors.
    pub priors: PriorErrors,
    /// Seed of all random draws: textures, cameras and errors. The same options write the same bytes.
    pub seed: u64,
}

impl ExtrapolationOptions {
    /// The usual options of a world: 160 x 160 pixels, 60 frames, NVFi's numbers of cameras.
    pub fn of(world: World) -> Self {
        let (cameras, held_out) = world.usual_cameras();
        Self {
            world,
            width: 160,
            height: 160,
            cameras,
            held_out,
            frames: 60,
            truth_every: 15,
            priors: PriorErrors::default(),
            seed: 0,
        }
    }

    /// The time of frame `index`: `index / frames`.
    pub fn time(&self, index: usize) -> f64 {
        index as f64 / self.frames as f64
    }

    /// The number of frames of each camera that are for training: those up to [`LAST_TRAINING_TIME`].
    pub fn training_frames(&self) -> usize {
        (0..self.frames).filter(|index| self.time(*index) <= LAST_TRAINING_TIME).count()
    }
}
