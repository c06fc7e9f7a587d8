//! Waymo Open Dataset, Perception: version 2 (Parquet files by component) and version 1 (records of frames).
//!
//! | file | holds |
//! |---|---|
//! | `names.rs` | recognising a segment by its path; sensors by number |
//! | `parts.rs` | a segment as both versions give it |
//! | `calibration.rs` | cameras and lasers |
//! | `range.rs` | range images to points |
//! | `segment.rs` | frames, images, sweeps and boxes of a segment |
//! | `modular/`, `parquet/` | version 2 |
//! | `record/` | version 1 |
//!
//! Only `names.rs` is there without the feature `waymo`.

pub(crate) mod names;

#[cfg(feature = "waymo")]
mod calibration;
#[cfg(feature = "waymo")]
mod modular;
#[cfg(feature = "waymo")]
mod parquet;
#[cfg(feature = "waymo")]
mod parts;
#[cfg(feature = "waymo")]
mod range;
#[cfg(feature = "waymo")]
mod record;
#[cfg(feature = "waymo")]
pub(crate) mod segment;
