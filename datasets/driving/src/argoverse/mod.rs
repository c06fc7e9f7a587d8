//! Argoverse 2 Sensor: Feather tables and JPEG images.
//!
//! | file | holds |
//! |---|---|
//! | `poses.rs` | poses over time, calibration |
//! | `describe.rs` | frames, cameras and images of a log |
//! | `sweep.rs` | sweeps and boxes |
//! | `ground.rs` | the ground by the log's map |

pub(crate) mod describe;
pub(crate) mod ground;
pub(crate) mod poses;
pub(crate) mod sweep;
