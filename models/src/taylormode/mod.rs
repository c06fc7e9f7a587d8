//! TaylorMoDe-GS: sharp moving scenes and their velocity out of blurred multi-view video.
//!
//! Each Gaussian moves along a Taylor series; its derivative is splatted to a velocity map, along which the sharp
//! rendering is blurred until it looks like the photo. The paper is "TaylorMoDe-GS: Taylor-Driven Gaussian Splatting
//! Motion Model for Multi-View Dynamic Scene Deblurring".
//!
//! | Paper | Here |
//! |---|---|
//! | 3.1, Eq. 2: Taylor motion | [`taylor_motion`], learned in the polynomials of [`window`]; [`paths`], evaluated |
//! | 3.1, Eq. 2: remainder `R_n(t)` | [`remainder`], in three dimensions; [`kinks`] at contacts |
//! | 3.2, Eq. 3: velocity | [`Paths::velocity`] |
//! | 3.2, Eq. 4: velocity splatting | the rasterizer's channels, fed with [`Paths::velocities`] |
//! | 3.2, Eq. 5: Peano remainder network; Table 2, "w/o Taylor expansion" | [`velocity_map`] |
//! | 3.3, Eq. 6: hybrid depth | [`blur_path::hybrid_depth`], with the prior of [`depth_prior`](crate::depth_prior) |
//! | 3.3, Eq. 7: exposure samples, learnable exposure | [`exposure`] |
//! | 3.3, Eq. 8 to 10: back-projection, camera-space velocity, re-projection | [`blur_path`], on rows of [`pixels`](crate::pixels) |
//! | 3.3, Eq. 11: blur weight network | [`blur_weights`] |
//! | 3.3, Eq. 12: blurred colour | [`blur_synthesis`], reading the image with [`bilinear`](gs_burn::ops::bilinear::bilinear()) |
//! | 3.4: gradient decoupling | [`blur_synthesis::decoupled`] |
//! | 3.4, Eq. 13 to 19: losses | [`losses`]; Eq. 16 in [`depth_prior`](crate::depth_prior) |
//! | not in the paper: no more motion than a scene needs | [`bodies`], [`shrinkage`], [`order`], [`summary`] |
//!
//! Two words that the code uses throughout: a *contact* is a stretch of time in which an object is hit (it lands,
//! bounces, is thrown), the same for the whole scene; a *kink* is the change of a Gaussian's velocity at a contact.

pub mod blur_path;
pub mod blur_synthesis;
pub mod blur_weights;
pub mod bodies;
pub mod exposure;
pub mod kinks;
pub mod losses;
pub mod order;
pub mod paths;
pub mod remainder;
pub mod scene;
pub mod shrinkage;
pub mod summary;
pub mod taylor_motion;
pub mod velocity_map;
pub mod window;

pub use blur_synthesis::{blurred_color, decoupled};
pub use blur_weights::{BlurWeights, BlurWeightsConfig};
pub use bodies::{Body, BodyFrame};
pub use exposure::{Exposure, PhotoShutter, Samples};
pub use kinks::{Contact, Kinks};
pub use order::Evidence;
pub use paths::{Instants, Paths, Shift};
pub use remainder::{Remainder, RemainderFrame, RemainderNetwork};
pub use scene::TaylorScene;
pub use summary::{FixedOrder, Size, Summary};
pub use taylor_motion::{MotionFrame, TaylorMotion};
pub use velocity_map::{DirectVelocity, DirectVelocityConfig, PeanoMap, PeanoMapConfig};
pub use window::TimeWindow;
