//! Readers for posed photo sets.
//!
//! [`load`] turns a folder into a [`Scene`]: photos undistorted and resized, cameras in one convention (OpenCV axes,
//! camera to world), points to start from, and named splits into training and held-out views. [`Log`] describes the
//! same folders and decodes a view when it is asked for; [`LogCache`] keeps decoded views under a bound in bytes.
//! Photos of a scene larger than [`LoadOptions::memory`] are decoded so too, by [`View::decoded`].
//! [`check`] reports contents and mistakes of a folder, [`load_cameras`] reads a camera path, and [`blur_from_frames`]
//! averages the frames of multi-view video to a blurred set with its truth. The crate `gs-worlds` writes synthetic
//! scenes.
//!
//! Read are the transforms.json family (instant-ngp, nerfstudio, Blender/NeRF, D-NeRF, NVFi, and blurred sets with
//! exposure, priors and truth), COLMAP models (text and binary), Panoptic sets, LLFF poses with frames of several
//! cameras, the multipleview layout of 4DGaussians, captures of Nerfies, tables of RealityScan, and the folders with a
//! text for each camera that OmniVGGT takes.
//!
//! Four words have one meaning each. A *photo* is an image that a camera took. A *frame* is the description of one
//! photo: its camera, time and files; a fisheye photo or a panorama has a frame for each pinhole view that is made of
//! it. A *view* is the record made from a frame, [`View`]: the undistorted photo at training size with its camera,
//! masks, priors and truth. A *split* is a named list of views. All fields of a view are
//! given by the data set; nothing inferred from photos is written there: the crate `gs-multiview` infers masks, tracks
//! and points. Neither knows tensors; the trainer turns a `Scene` into them.
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

mod behind;
mod blur_from_frames;
pub mod camera_path;
mod check;
mod consistency;
mod convention;
mod decode;
mod description;
mod distortion;
mod error;
mod exr_file;
mod face;
mod faces;
mod findings;
mod fold;
mod folder;
mod foreign;
mod formats;
mod frame;
pub mod image_io;
mod jpeg;
mod lens;
pub mod light;
mod linear;
mod loader;
mod log;
mod log_cache;
mod map;
mod mask;
mod movers;
mod names;
mod notes;
mod on_demand;
mod one_color;
mod options;
mod order;
mod photo;
mod pixels;
mod ply;
mod pose;
mod priors;
mod projection;
mod raw;
mod reduce;
mod resample;
mod resize;
mod scene;
mod side_files;
mod split;
mod subject;
mod undistort;

pub use blur_from_frames::{BlurFromFrames, BlurSummary, blur_from_frames};
pub use check::{CheckReport, Common, check, said_once, write_findings};
pub use consistency::frame_interval;
pub use convention::{CameraAxis, PoseConvention, mirrored};
pub use distortion::Distortion;
pub use error::DatasetError;
pub use frame::{CameraPose, DepthPrior, DepthSpace, PhotoSource, Priors, RgbImage8, Truth, View};
pub use loader::{load, load_cameras, load_cameras_by};
pub use log::{FrameDescription, FrameSource, Log};
pub use log_cache::LogCache;
pub use movers::{Mover, movers};
pub use names::some_names;
pub use on_demand::{Decoded, surveyed};
pub use options::{
    DEFAULT_HOLDOUT, DepthKind, Holdout, LoadOptions, MaskUse, PriorUse, RowOrder, SparseViews, SplitUse,
};
pub use photo::{ExrChannels, decode_photo, downscaled_size, photo_size, read_exr, read_photo};
pub use priors::depth::{DepthMap, read_depth};
pub use priors::sources::find_depth;
pub use scene::{PointCloud, Scene, SceneFormat, Split};
pub use split::{ViewKind, view_kind};
pub use subject::{nearest_to_axes, subject, subject_distance};
pub use undistort::Undistortion;
