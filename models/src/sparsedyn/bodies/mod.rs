//! Bodies with laws of motion: what many Gaussians do together costs a body, not its Gaussians.
//!
//! The paper gives every Gaussian a motion of its own by the field. Most scenes hold a few bodies. While frames come to
//! light a body moves freely and its nodes bend it ([`motion`], [`nodes`]). Then each body, or rigid part of one
//! ([`mod@segment`]), gets the simplest law ([`mod@law`], [`mod@fit`]) that its poses bear out by BIC, from the time on
//! at which it holds ([`phases`]); what bends gets oscillations ([`bending`]). A law says what the body does next; a
//! field says so only as far as its network happens to.
//!
//! | file | holds |
//! |---|---|
//! | [`law`] | laws as sets of terms; a pose at a time |
//! | [`fit`] | the law of a sequence of poses, and the choice among laws |
//! | [`phases`] | laws that hold from a time on |
//! | [`bending`] | the law of a body that bends |
//! | [`rhythm`] | oscillations that the nodes of a body share |
//! | [`mod@segment`] | bodies among paths |
//! | [`parts`] | a body divided, and parts joined that move alike |
//! | [`motion`] | bodies as a Burn module: laws, free motions and nodes, learned from photos |
//! | [`mod@basis`] | the functions of time of a free motion |
//! | [`nodes`] | nodes that bend a body, and their weights |

pub mod basis;
pub mod bending;
pub mod fit;
pub mod law;
mod least_squares;
pub mod motion;
pub mod nodes;
pub mod parts;
pub mod phases;
pub mod rhythm;
pub mod rigid;
pub mod segment;
mod transforms;

pub use fit::{Fitted, compare_laws, fit_law, select_law};
pub use law::{BodyPose, Law, LawValues, Term};
pub use motion::{Bodies, Body, BodyFrame, Span};
pub use nodes::NodeFrame;
pub use segment::{SegmentOptions, segment};
