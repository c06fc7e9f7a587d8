//! Files of 3D Gaussians. Knows slices, nothing of tensors or training.
//!
//! [`Splats`] are Gaussians on the host, [`Motion`] says how some of them move. [`ply`] (the layout of 3DGS), [`spz`]
//! and [`glb`] are read and written, [`splat`], [`ksplat`] and [`sog`] are read, [`usda`] is written.
//! `docs/formats.md` has the layouts.
//!
//! # Axes
//!
//! `Splats` have the axes that viewers take a PLY for: x right, y down, z forward, as in COLMAP (RDF). SPZ, glTF and
//! our OpenUSD files have y up (RUB). Writers turn by 180 degrees about x, which is a change of signs and loses
//! nothing, and readers turn back. A world whose up is another axis is turned first: [`turn::turn`].

mod bounded;
mod carried;
pub mod glb;
mod json;
pub mod ksplat;
mod merge;
mod motion;
pub mod ply;
mod sh_rotation;
pub mod sog;
pub mod splat;
mod splats;
pub mod spz;
pub mod turn;
pub mod usda;

pub use carried::{Carried, Carrier};
pub use merge::Merged;
pub use motion::{Beyond, Keys, Law, Motion, Series, SeriesLaw, Shape, TimeFunction};
pub use splats::Splats;

/// Longest file that is read whole, bytes: 67 million Gaussians of degree 3 as glTF take 16 GB, and nobody passes such
/// files on.
pub(crate) const FILE_MAX: u64 = 8 << 30;

/// Most Gaussians that are read: 67 million, which take 16 GB at degree 3.
pub const COUNT_MAX: usize = 1 << 26;

/// The mark of our files; a later file may be written over one that says so.
pub const MARK: &str = "written by gsburn";
