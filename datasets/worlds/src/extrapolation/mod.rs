//! [`write()`]: rigid objects with steady laws of motion, filmed by static cameras, of which the last quarter is to be
//! predicted.
//!
//! The worlds are in the manner of NVFi's Dynamic Objects and Dynamic Indoor Scenes: 60 frames over one unit of time,
//! of which those up to [`LAST_TRAINING_TIME`] are for training.
//!
//! | file | holds |
//! |---|---|
//! | `scenes/extrapolation/*.toml` | the worlds; `light.toml` is common to all but the room |
//! | `priors.rs` | depth and confidence with the errors of a feed-forward reconstructor |
//! | `write.rs` | cameras, the files of a photo, the points that the priors place |
//!
//! Rays, light and motion are those of `tracer/`. Nothing here is shared with the rasterizer that learns from these
//! images.

mod priors;
mod write;

#[cfg(test)]
mod tests;

use std::fmt;
use std::str::FromStr;

pub use priors::PriorErrors;
pub use write::write;

/// Frames up to this time are for training; NVFi's split.
pub const LAST_TRAINING_TIME: f64 = 0.75;

/// Descriptions of the worlds.
const FAN: &str = include_str!("../../scenes/extrapolation/fan.toml");
const FALLING_BALL: &str = include_str!("../../scenes/extrapolation/falling-ball.toml");
const SLIDER: &str = include_str!("../../scenes/extrapolation/slider.toml");
const PENDULUM: &str = include_str!("../../scenes/extrapolation/pendulum.toml");
const HINGE: &str = include_str!("../../scenes/extrapolation/hinge.toml");
const TELESCOPE: &str = include_str!("../../scenes/extrapolation/telescope.toml");
const SPINNER: &str = include_str!("../../scenes/extrapolation/spinner.toml");
const DUO: &str = include_str!("../../scenes/extrapolation/duo.toml");
const ROOM: &str = include_str!("../../scenes/extrapolation/room.toml");

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

    /// The name, the motion in a few words, and the description.
    fn row(self) -> [&'static str; 3] {
        match self {
            Self::Fan => ["fan", "A rotor turns steadily on a stand", FAN],
            Self::FallingBall => ["falling-ball", "A ball falls freely beside a still object", FALLING_BALL],
            Self::Slider => ["slider", "A box slides past a still object and slows down", SLIDER],
            Self::Pendulum => ["pendulum", "A bob on a rod swings in a frame", PENDULUM],
            Self::Hinge => ["hinge", "The lid of a box opens ever faster", HINGE],
            Self::Telescope => ["telescope", "Three nested bodies move apart at steady velocities", TELESCOPE],
            Self::Spinner => ["spinner", "A lopsided body turns ever faster", SPINNER],
            Self::Duo => ["duo", "A thrown ball, and a box that drifts and turns", DUO],
            Self::Room => ["room", "A room with a sliding box, a spinning top, a pendulum and a rising box", ROOM],
        }
    }

    /// The world's name in lower case, as [`FromStr`] reads it.
    pub fn name(self) -> &'static str {
        self.row()[0]
    }

    /// The motion in it, in a few words.
    pub fn in_words(self) -> &'static str {
        self.row()[1]
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
