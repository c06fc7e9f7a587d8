//! What moves, in a small analytic world: standing cameras on an arc look at textured spheres over a textured floor.

mod evidence;
mod fixture;
mod guide;
mod hostile;
mod hull;
mod pinned;
mod shadows;
mod sweep;
mod trajectory;
