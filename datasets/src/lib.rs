//! Readers for posed photo sets, and a small synthetic world.
//!
//! [`load`] turns a folder into a [`Scene`]: photos undistorted and resized, cameras in one convention (OpenCV axes,
//! camera to world), points to start from, and a split into training and held-out views. It reads the transforms.json
//! family (instant-ngp, nerfstudio, Blender/NeRF, D-NeRF, NVFi, and blurred sets with exposure, priors and truth), COLMAP
//! models (text and binary), Panoptic sets and LLFF poses with frames of several cameras. [`check`] says what
//! is in a folder and what is wrong with it, [`load_cameras`] reads a camera path, and [`synthetic`] writes a scene with
//! known ground truth. Nothing is inferred here: the crate `gs-multiview` finds what moves in a scene. Neither knows tensors;
//! the trainer turns a `Scene` into them.
//!
//! ```no_run
//! use gs_datasets::{LoadOptions, load};
//!
//! # fn main() -> Result<(), gs_datasets::DatasetError> {
//! let options = LoadOptions { max_width: Some(480), ..LoadOptions::default() };
//! let scene = load("my-photos".as_ref(), &options)?;
//! println!("{} views to learn from, {} held out", scene.train.len(), scene.held_out_views().count());
//! # Ok(())
//! # }
//! ```

mod check;
mod consistency;
mod decode;
mod description;
mod error;
mod findings;
mod formats;
mod frame;
pub mod image_io;
mod jpeg;
mod lens;
pub mod light;
mod loader;
mod log;
mod log_cache;
mod mask;
mod names;
mod options;
mod order;
mod pixels;
mod ply;
mod pose;
mod priors;
mod raw;
mod resample;
mod resize;
mod scene;
mod side_files;
mod split;
mod statistics;
mod subject;
pub mod synthetic;
mod undistort;

pub use check::{CheckReport, check};
pub use consistency::frame_interval;
pub use error::DatasetError;
pub use frame::{CameraPose, DepthPrior, DepthSpace, Intrinsics, Priors, RgbImage8, Truth, View};
pub use loader::{load, load_cameras};
pub use log::{FrameDescription, FrameSource, Log};
pub use log_cache::LogCache;
pub use options::{DEFAULT_HOLDOUT, DepthKind, Holdout, LoadOptions, MaskUse, PriorUse, RECENTRE_DISTANCE, SplitUse};
pub use names::some_names;
pub use scene::{PointCloud, Scene, SceneFormat, Split};
pub use statistics::mean;
pub use subject::{nearest_to_axes, subject};
