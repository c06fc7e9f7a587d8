//! The data set as the trainer wants it: what to load ([`DataConfig`]), which view comes next ([`Order`]),
//! views as tensors ([`Photos`]), whether it suits a configuration, what it settles of one ([`settled()`]), and whether it is still
//! the same ([`Fingerprint`]).

mod config;
mod fingerprint;
mod order;
mod photos;
mod settled;
mod suits;

pub use config::{Auto, Background, DataConfig, DepthChoice, HoldoutChoice, MaskChoice, PriorKind};
pub use fingerprint::Fingerprint;
pub use order::{Curriculum, Order, Sampler};
pub use photos::{Hints, Photo, Photos, camera, intrinsics, to_tensor};
pub use settled::settled;
pub use suits::{check_pixels, check_times, near_warning, no_pixels};
