//! The viewer: a scene in three dimensions and through time, in one page that needs no other file and no network.
//!
//! A scene becomes JSON and a block of numbers (`scene`, `block`); its motion becomes blocks with weights over time
//! (`motion`). The script draws it with WebGL 2 as the rasterizer does: the same projection, dilation, clipping,
//! thresholds and order. `docs/viewing.md` says how far the two agree.

mod block;
mod motion;
mod page;
mod scene;

pub use page::{live_page, page, page_of, section};
pub use scene::{GAUSSIANS_MAX, Packed, WITH_SH_MAX, packed};
