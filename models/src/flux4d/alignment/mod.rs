//! Motion of rigid bodies between the sweeps of a snippet, from the points alone: no label, no network, no image.
//!
//! The paper's velocities are learned from images alone in 30,000 steps. Here the motion that the sweeps themselves
//! show teaches a network and counts before it.
//!
//! 1. A point moves by evidence where later or earlier rays passed through its place (`evidence`, `free_space`).
//! 2. Such points of one sweep that are close to each other are a body (`bodies`, `groups`).
//! 3. A body's velocity, acceleration and turn are those that bring its points onto the points of the other sweeps
//!    (`search`), by the distance to the nearest of them in the plan (`plan`). A sweep that does not see a place says
//!    nothing against a motion into it (`shadow`).
//! 4. Bodies of different sweeps that move alike are one, which has one motion and is carried to the sweeps in which it
//!    is not evident. A body whose motion does not explain its points better than rest does, in all sweeps together,
//!    rests (`tracks`).
//! 5. Points near a body that its motion explains belong to it, but for surfaces that stay when it has gone (`claims`).
//! 6. What is evident and belongs to no body is looked at again at a coarser scale: a car 40 m away is two beams, which
//!    meet another part of it in each sweep (`align`).
//!
//! A sweep is that of one LiDAR, and each of its directions has a time of its own (`clock`).
//!
//! Motion is horizontal. Heights are above the ground under a point (`ground`).

mod align;
mod aligned;
mod bodies;
mod candidate;
mod claims;
mod clock;
mod evidence;
mod footprint;
mod free_space;
mod ground;
mod groups;
mod plan;
mod search;
mod shadow;
mod sweeps;
#[cfg(test)]
mod tests;
mod tracks;

pub use align::align;
pub use aligned::Aligned;
pub use search::PlanarMotion;

/// The points of one sweep of one LiDAR.
#[derive(Debug, Clone, Copy)]
pub struct AlignedSweep<'a> {
    /// Metres, z up, the ego vehicle's motion compensated.
    pub points: &'a [[f32; 3]],
    /// Seconds, one a point.
    pub times: &'a [f64],
    /// Position of the LiDAR, metres.
    pub origin: [f64; 3],
}

/// A point from above.
fn in_plan(point: &[f32; 3]) -> [f64; 2] {
    [0, 1].map(|axis| f64::from(point[axis]))
}
