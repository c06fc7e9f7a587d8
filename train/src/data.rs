//! The data set as the trainer wants it: what to load ([`DataConfig`]), which view comes next ([`Sampler`], [`Curriculum`]),
//! and views as tensors ([`Photos`]).

mod config;
mod order;
mod photos;

pub use config::{DataConfig, DepthChoice, HoldoutChoice, MaskChoice, PriorKind};
pub use order::{Curriculum, Sampler};
pub use photos::{Hints, Photo, Photos, camera, intrinsics, to_tensor};
