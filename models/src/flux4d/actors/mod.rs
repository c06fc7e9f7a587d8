//! Moving objects without labels (Algorithm 3), and changes of them.
//!
//! | part | file |
//! |---|---|
//! | clustering | [`dbscan`](mod@dbscan) |
//! | actors of a scene: box, speed, track | [`found`] |
//! | the same actor in the next snippet | [`link`] |
//! | remove, insert, move, recolour | [`edits`], applied by [`apply`] |

pub mod apply;
pub mod dbscan;
pub mod edits;
pub mod found;
pub mod link;

pub use apply::{Edited, apply_edits};
pub use dbscan::dbscan;
pub use edits::{Edit, EditScript};
pub use found::{Actor, ActorBox, ActorConfig, TrackPoint, clustered, described, find_actors};
pub use link::{LinkConfig, Tracks, link_actors};
