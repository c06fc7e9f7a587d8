//! What moves, where, and how fast, from photos and cameras alone: no tensors, no network, no training.
//!
//! | step | file |
//! |---|---|
//! | views of one camera that stands still; views of one time | [`cameras`](static_cameras) |
//! | what a standing camera sees when nothing passes | [`background`] |
//! | pixels that differ from it by more than noise and shadow | [`evidence`] |
//! | masks given or found, one per training view | [`moving_masks`] |
//! | the object's centre per time, its velocity (TaylorMoDe-GS, Eq. 17) | [`centres`], [`guide_velocity`] |
//! | the same for several objects | [`object_centres`] |
//! | a polynomial through the centres, its order chosen by BIC, with kinks where they were hit | [`Trajectory`] |
//! | coloured points on the object at a time, by carving | [`hull`] |
//! | points where photos agree, by a plane sweep | [`sweep`] |
//!
//! Blurry photos: a mask found here covers everything the object touched while the shutter was open. For an object that
//! moves steadily this is symmetric about the exposure's centre, so centres and velocities stay unbiased; silhouettes
//! are longer along the motion by up to the path of one exposure, and hulls with them.

mod background;
mod cameras;
mod carve;
mod cluster;
mod evidence;
mod geometry;
mod guide;
mod hull;
mod illumination;
mod least_squares;
mod masks;
mod median;
mod noise;
mod objects;
mod pixels;
mod regions;
mod shadow;
mod sweep;
mod trajectory;
mod triangulate;

pub use background::{Background, background};
pub use cameras::{StaticCamera, static_cameras};
pub use evidence::{Evidence, FRAMES_MIN, evidence};
pub use geometry::Pinhole;
pub use guide::{Centre, Centres, centres, guide_velocity};
pub use hull::{Hull, HullOptions, hull};
pub use least_squares::{least_squares, weighted_least_squares};
pub use masks::{MaskOrigin, MaskSource, MovingMasks, changing, moving_masks};
pub use objects::object_centres;
pub use sweep::sweep;
pub use trajectory::{Kink, Trajectory};
