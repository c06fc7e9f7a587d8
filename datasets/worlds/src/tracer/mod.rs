//! An analytic ray tracer of rigid objects: the parts that all moving worlds share.
//!
//! | file | holds |
//! |---|---|
//! | `motion.rs` | rigid motion in closed form, with its velocity |
//! | `texture.rs`, `solid.rs`, `stage.rs` | paint; forms and where rays meet them; light and shadows at an instant |
//! | `camera.rs` | pinhole cameras |
//! | `truth.rs` | poses and velocities of moving objects as JSON |
//!
//! Light is added up in linear light with the curve of [`gs_datasets::light`].

pub(super) mod camera;
pub(super) mod motion;
pub(super) mod solid;
pub(super) mod stage;
pub(super) mod texture;
pub(super) mod truth;
