//! Scene-flow metrics, with every variant that is in use under a name of its own.
//!
//! A flow is the displacement of a point in one LiDAR period, **metres per frame of 0.1 s**, in world axes, so the
//! motion of the recording car is not in it.
//!
//! | metric | file |
//! |---|---|
//! | EPE3D, Acc5 and Acc10 in two variants, angle in three | [`errors`] |
//! | EPE of resting background, resting foreground, moving foreground | [`three_way`] |
//! | normalised EPE by class and speed | [`buckets`] |

pub mod buckets;
pub mod errors;
pub mod points;
pub mod three_way;

pub use buckets::{Bucketed, Buckets, ClassError};
pub use errors::{Errors, PointErrors};
pub use points::{FlowClass, FlowFrame};
pub use three_way::{Columns, ThreeWay, ThreeWayReport};
