//! Classical multi-view vision for posed photos: static cameras, backgrounds, moving masks, centres, paths and hulls of
//! moving objects, and points by a plane sweep. No tensors, no network, no training.
//!
//! Main types: [`MovingMasks`] (one mask per training view), [`Centre`] and [`Trajectory`] (a path through triangulated
//! centres), [`Hull`] (coloured points on the moving object), [`CueOptions`] (every heuristic). Neighbours:
//! `gs-datasets` reads the [`Scene`](gs_datasets::Scene) that every function takes; the trainer initialises Gaussians
//! from the results. A `Scene` holds what the data set gives, and this crate what is inferred from it: no function
//! changes a view, and no result belongs into one.
//!
//! | step | function |
//! |---|---|
//! | views of one static camera | [`static_cameras`] |
//! | picture of a static camera without passing objects | [`background`](fn@background) |
//! | pixels that differ from it by more than noise and shadow | [`camera_masks`](fn@camera_masks) |
//! | pixels that differ from a background of one colour | [`foreground_masks`] |
//! | one mask per training view, given or inferred | [`moving_masks`] |
//! | centre and velocity of the moving object (Eq. 17 of TaylorMoDe) | [`centres`](fn@centres), [`guide_velocity`] |
//! | centres of several objects | [`object_centres`] |
//! | objects that move apart, each with its path | [`tracks`](fn@tracks) |
//! | path through the centres: polynomial order and kinks by BIC | [`Trajectory`] |
//! | coloured points on the object at a time, by space carving | [`hull`](fn@hull) |
//! | points for data sets without any, by a plane sweep | [`plane_sweep`](fn@plane_sweep) |
//! | more points where some are known | [`plane_sweep_around`] |
//! | whether poses agree with photos and points, and in which convention they would | [`judge_poses`] |
//!
//! Heuristics are fields of [`CueOptions`]; constants that follow from statistics are not.
//!
//! Blurry photos: an inferred mask covers all pixels that the object touched during the exposure. For steady motion it
//! is symmetric about the exposure's centre, so centres and velocities stay unbiased. Silhouettes, and hulls with them,
//! are longer along the motion by up to the path of one exposure.
//!
//! ```no_run
//! use gs_datasets::{LoadOptions, load};
//! use gs_multiview::{CueOptions, MaskSource, Trajectory, centres, hull, moving_masks};
//!
//! # fn main() -> Result<(), gs_datasets::DatasetError> {
//! let scene = load("my-video".as_ref(), &LoadOptions::default())?;
//! let options = CueOptions::default();
//! let masks = moving_masks(&scene, MaskSource::Auto, &options.masks).masks;
//! let centres = centres(&scene, &masks).centres;
//! if let Some(path) = Trajectory::fit(&centres, 5, 2) {
//!     println!("order {}, {} kinks, at {}", path.order(), path.kinks.len(), path.position(0.5));
//! }
//! println!("{} points on the object", hull(&scene, &masks, 0.5, &options.hull).points.len());
//! # Ok(())
//! # }
//! ```

mod backdrop;
mod background;
mod camera_masks;
mod cameras;
mod carve;
mod centres;
mod cluster;
mod depth_range;
mod gains;
mod grey;
mod hull;
mod illumination;
mod masks;
mod matches;
mod noise;
mod objects;
mod options;
mod patch;
mod pinhole;
mod pixels;
mod plane_sweep;
mod pose_evidence;
mod pose_sentences;
mod poses;
mod regions;
mod shadow;
mod tracks;
mod trajectory;
mod triangulate;

pub use backdrop::foreground_masks;
pub use background::{Background, background};
pub use camera_masks::{CameraMasks, FRAMES_MIN, camera_masks};
pub use cameras::{StaticCamera, static_cameras};
pub use centres::{Centre, Centres, centres, guide_velocity};
pub use gains::{Gains, gains};
pub use hull::{Hull, hull};
pub use masks::{MaskOrigin, MaskSource, MovingMasks, inferred_masks, moving_masks};
pub use objects::object_centres;
pub use options::{CueOptions, HullOptions, MaskOptions, ObjectOptions, OptionError, REFERENCE_WIDTH};
pub use pinhole::Pinhole;
pub use plane_sweep::{plane_sweep, plane_sweep_around};
pub use pose_evidence::PointEvidence;
pub use poses::{Camera, Evidence, PointsFault, PoseJudgement, PosePairs, PoseVerdict, judge_poses, pose_pairs};
pub use tracks::{ImageScale, Track, tracks};
pub use trajectory::{Kink, Trajectory};
