//! Driving logs of all layouts, real ones and logs written here.

mod argoverse;
mod samples;
mod streets;
mod trouble;
#[cfg(feature = "waymo")]
mod waymo;
