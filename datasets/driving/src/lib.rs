//! Driving logs: cameras and LiDAR on a moving vehicle.
//!
//! [`DrivingLog`] describes a log of PandaSet (both of its pickle layouts), of Argoverse 2 Sensor or, with the feature
//! `waymo`, of the Waymo Open Dataset (both versions), and decodes a [`Sweep`] or an image when it is asked for.
//! [`snippets`] cuts a log into the pieces that are reconstructed together, [`colors`] gives points the colours of the
//! images, [`check`] reports what is there, and [`layout`] holds the names and writers of PandaSet's files. The crate
//! `gs-worlds` writes streets with exact truth in that layout.
//!
//! Neighbours: `gs-datasets` has the errors, the photos and the caches ([`DrivingLog`] is a
//! [`FrameSource`](gs_datasets::FrameSource)). The crate knows no tensors. Nothing in a file can run code: see the
//! whitelisted reader in `pickle/`; `feather/` reads Arrow's files.
//!
//! ```no_run
//! use gs_driving::{DrivingLog, LogOptions, SnippetKind, colors, snippets};
//!
//! # fn main() -> Result<(), gs_datasets::DatasetError> {
//! let log = DrivingLog::open("pandaset/002".as_ref(), &LogOptions::default())?;
//! for snippet in snippets(log.frames().len(), SnippetKind::Interpolation) {
//!     for frame in &snippet.inputs {
//!         let sweep = log.sweep(*frame)?;
//!         println!("{} points, {} colours", sweep.len(), colors(&log, *frame, &sweep)?.iter().flatten().count());
//!     }
//! }
//! # Ok(())
//! # }
//! ```

mod argoverse;
mod boxes;
mod check;
mod description;
mod draw;
mod faults;
mod feather;
mod gzip;
pub mod layout;
mod log;
mod options;
mod pandaset;
mod pickle;
mod project;
mod snippet;
mod sweep;
mod waymo;

pub use argoverse::ground::MapGround;
pub use boxes::{FLOW_INTERVAL, MOVING_FLOW};
pub use check::{DrivingReport, check};
pub use description::{Camera, Frame, Shot};
pub use log::{DrivingLog, LogFormat, logs_in};
pub use options::{CameraUse, LogOptions};
pub use pandaset::truth_image::{TruthImage, truth_image};
pub use project::{NEAR, colors, depth_image, project, sample};
pub use snippet::{
    INTERPOLATION_FRAMES, OVERLAP, PREDICTION_FRAMES, Snippet, SnippetKind, TEST_LOGS, TEST_LOGS_ARGOVERSE, gaps, runs,
    snippets, snippets_without_gaps, spaced,
};
pub use sweep::{Cuboid, Labels, ObjectClass, RANGE_MAX, Sweep};
