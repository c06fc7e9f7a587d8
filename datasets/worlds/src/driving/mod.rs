//! Streets with exact truth, ray traced and written in the layout of PandaSet.
//!
//! [`write()`] makes one log: a vehicle with up to six cameras and a spinning LiDAR drives along a street with
//! buildings, trees, parked vehicles and moving ones: some brake, some turn at the crossing, cyclists ride and people
//! walk. Each seed is another street with other traffic. Shapes and rays are those of `tracer/`. Nothing here is
//! shared with the rasterizer that learns from these logs.
//!
//! | file | holds |
//! |---|---|
//! | `options.rs` | [`StreetOptions`] |
//! | `path.rs` | paths over time in closed form |
//! | `body.rs`, `paint.rs` | vehicles, people, trees and houses; their colours |
//! | `street.rs`, `traffic.rs` | the street of a seed, and what moves on it |
//! | `instant.rs` | the street at a time: nearest surface along a ray, light, shadow |
//! | `rig.rs`, `film.rs`, `lidar.rs` | sensors, images and sweeps |
//! | `files.rs`, `records.rs`, `write.rs` | the files |
//!
//! Beside the layout of PandaSet a log has exact truth:
//!
//! | file | holds |
//! |---|---|
//! | `truth/points/NN.pkl.gz` | a table with one row a LiDAR point: `flow.x`, `flow.y`, `flow.z` (metres in the next 0.1 s, world), `instance`, `class`, `semantic` |
//! | `truth/images/CAMERA/NN.exr` | channels `Z` (camera z in metres, 0 for sky), `VX`, `VY`, `VZ` (flow in metres in the next 0.1 s, world), `ID` (object) |
//! | `truth/actors.json` | every vehicle and person: number, track, label, size, and position, heading and speed at each frame |
//!
//! A point's flow is from its own time on, and a pixel's from the time of its image. [`gs_driving::truth_image`] reads
//! a file of the second kind.

mod body;
mod files;
mod film;
mod instant;
mod lidar;
mod options;
mod paint;
mod path;
mod records;
mod rig;
mod street;
mod traffic;
mod write;

pub use options::{Encounter, StreetOptions};
pub use write::write;
