//! Changes of a scene's actors as data: remove, insert, move, recolour.
//!
//! ```toml
//! [[edits]]
//! do = "remove"
//! actor = 0
//!
//! [[edits]]
//! do = "insert"             # a copy of actor 1
//! actor = 1
//! offset = [0.0, 3.5, 0.0]  # metres, world
//! turn = 90.0               # degrees about the vertical through the actor's centre
//! ```
//!
//! Edits apply in their order, each to the actor as the edits before it left it. Inserted actors are numbered after the
//! others, in order. A turn also turns the path: the velocity turns with the body.

use serde::{Deserialize, Serialize};

/// One change.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Edit {
    /// The actor vanishes. Its number stays taken.
    Remove {
        /// Number in the list of actors.
        actor: usize,
    },
    /// A copy of the actor appears elsewhere.
    Insert {
        /// Number of the actor that is copied.
        actor: usize,
        /// World, metres.
        #[serde(default)]
        offset: [f64; 3],
        /// Degrees about the vertical through the actor's centre, counter-clockwise seen from above.
        #[serde(default)]
        turn: f64,
    },
    /// The actor is elsewhere.
    Move {
        /// Number in the list of actors.
        actor: usize,
        /// World, metres.
        #[serde(default)]
        offset: [f64; 3],
        /// Degrees, as in `Insert`.
        #[serde(default)]
        turn: f64,
    },
    /// The actor's colours are mixed with one.
    Recolor {
        /// Number in the list of actors.
        actor: usize,
        /// 0 to 1.
        color: [f64; 3],
        /// Share of the new colour, 0 to 1.
        share: f64,
    },
}

/// Edits in their order.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EditScript {
    /// The edits.
    #[serde(default)]
    pub edits: Vec<Edit>,
}
