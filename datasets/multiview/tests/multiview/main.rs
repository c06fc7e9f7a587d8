//! What moves, in a small analytic world: static cameras on an arc look at textured spheres over a textured floor.

mod camera_masks;
mod centres;
mod fixture;
mod gains;
mod hostile;
mod hull;
mod pinned;
mod plane_sweep;
mod poses;
mod shadows;
mod tracks;
mod trajectory;
