//! TaylorMoDe-GS: sharp moving scenes out of blurred multi-view video.

pub mod exposure;
pub mod remainder;
pub mod rotation;
pub mod taylor_motion;
pub mod window;

pub use exposure::{Exposure, Samples};
pub use remainder::{Remainder, RemainderNetwork};
pub use taylor_motion::{Instant, TaylorMotion, TaylorScene};
pub use window::TimeWindow;
