//! [`write()`]: rigid objects with steady laws of motion, filmed by static cameras, of which the last quarter is to be predicted.
//!
//! The worlds are in the manner of NVFi's Dynamic Objects and Dynamic Indoor Scenes: 60 frames over one unit of time, of which those up
//! to [`LAST_TRAINING_TIME`] are for training.
//!
//! | file | holds |
//! |---|---|
//! | `objects.rs`, `room.rs` | the worlds |
//! | `scene.rs` | a world with its light |
//! | `rig.rs` | the cameras |
//! | `film.rs` | sharp images with transparency, depth, velocity, masks |
//! | `priors.rs` | depth and confidence with the errors of a feed-forward reconstructor |
//! | `points.rs` | the points that these priors place |
//! | `write.rs` | the folder and its JSON |
//!
//! Rays, light and motion are those of `tracer/`. Nothing here is shared with the rasterizer that learns from these images.

mod film;
mod objects;
mod points;
mod priors;
mod rig;
mod room;
mod scene;
mod write;

#[cfg(test)]
mod tests;

use std::fmt;
use std::str::FromStr;

pub use priors::PriorErrors;
pub use write::write;

/// Frames up to this time are for training; NVFi's split.
pub const LAST_TRAINING_TIME: f64 = 0.75;

/// The worlds. All but the last are objects before a transparent background.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum World {
    /// A rotor turns steadily on a stand.
    Fan,
    /// A ball falls freely beside a still object.
    FallingBall,
    /// A box slides past a still object and slows down.
    Slider,
    /// A bob on a rod swings in a frame.
    Pendulum,
    /// The lid of a box opens ever faster.
    Hinge,
    /// Three nested bodies move apart, each at its own steady velocity.
    Telescope,
    /// A lopsided body turns ever faster.
    Spinner,
    /// A thrown ball, and a box that drifts and turns.
    Duo,
    /// A textured room with a sliding box, a spinning top, a pendulum and a rising box.
    Room,
}

impl World {
    /// All worlds.
    pub const ALL: [Self; 9] = [
        Self::Fan,
        Self::FallingBall,
        Self::Slider,
        Self::Pendulum,
        Self::Hinge,
        Self::Telescope,
        Self::Spinner,
        Self::Duo,
        Self::Room,
    ];

    /// The world's name in lower case, as [`FromStr`] reads it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fan => "fan",
            Self::FallingBall => "falling-ball",
            Self::Slider => "slider",
            Self::Pendulum => "pendulum",
            Self::Hinge => "hinge",
            Self::Telescope => "telescope",
            Self::Spinner => "spinner",
            Self::Duo => "duo",
            Self::Room => "room",
        }
    }

    /// The motion in it, in a few words.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Fan => "A rotor turns steadily on a stand",
            Self::FallingBall => "A ball falls freely beside a still object",
            Self::Slider => "A box slides past a still object and slows down",
            Self::Pendulum => "A bob on a rod swings in a frame",
            Self::Hinge => "The lid of a box opens ever faster",
            Self::Telescope => "Three nested bodies move apart at steady velocities",
            Self::Spinner => "A lopsided body turns ever faster",
            Self::Duo => "A thrown ball, and a box that drifts and turns",
            Self::Room => "A room with a sliding box, a spinning top, a pendulum and a rising box",
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

impl fmt::Display for World {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for World {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|world| world.name() == name);
        found.ok_or_else(|| format!("expected {}, found {name:?}", Self::ALL.map(Self::name).join(", ")))
    }
}

/// Options of [`write()`].
#[derive(Debug, Clone, PartialEq)]
pub struct ExtrapolationOptions {
    /// Which world.
    pub world: World,
    /// Image width, 8 to 8192 pixels.
    pub width: usize,
    /// Image height, 8 to 8192 pixels.
    pub height: usize,
    /// Cameras, held-out ones included, 1 to 1000. They stand all around: on a dome outside of objects, under the ceiling of a room.
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
