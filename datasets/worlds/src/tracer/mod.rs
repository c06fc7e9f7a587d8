//! An analytic ray tracer of rigid bodies.
//!
//! | file | holds |
//! |---|---|
//! | `shape.rs`, `solid.rs` | shapes and where rays meet them; bodies of painted parts |
//! | `motion.rs` | rigid motion in closed form, with its velocity |
//! | `texture.rs`, `scene.rs` | paint; light and shadows at an instant |
//! | `description.rs`, `vector.rs` | scenes from TOML |
//! | `camera.rs` | pinhole cameras |
//!
//! Light is added up in linear light with the curve of [`gs_datasets::light`].

pub(crate) mod camera;
pub(crate) mod description;
pub(crate) mod motion;
pub(crate) mod scene;
pub(crate) mod shape;
pub(crate) mod solid;
pub(crate) mod texture;
mod vector;
