//! Rigid bodies with laws of motion: what many Gaussians do together costs a body, not its Gaussians.
//!
//! The paper gives every Gaussian a motion of its own by the field. Most scenes hold a few bodies: here Gaussians whose
//! paths are one rigid motion are found ([`mod@segment`]), and each body gets the simplest law ([`mod@law`],
//! [`mod@fit`]) that its poses bear out by BIC. A law says what the body does next; a field says so only as far as its
//! network happens to. What is no rigid body stays with the field.
//!
//! | file | holds |
//! |---|---|
//! | [`law`] | laws as sets of terms; a pose at a time |
//! | [`fit`] | the law of a sequence of poses, and the choice among laws |
//! | [`mod@segment`] | bodies among paths |
//! | [`parts`] | a body divided, and parts joined that move alike |
//! | [`motion`] | bodies as a Burn module: the laws' numbers, learned from photos |

pub mod fit;
pub mod law;
mod least_squares;
pub mod motion;
pub mod parts;
pub mod rigid;
pub mod segment;

pub use fit::{Fitted, compare_laws, fit_law, select_law};
pub use law::{BodyPose, Law, LawValues, Term};
pub use motion::{Bodies, BodyFrame};
pub use segment::{SegmentOptions, segment};
