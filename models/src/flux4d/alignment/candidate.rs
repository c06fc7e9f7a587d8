//! A body of a sweep before its points are known.

use super::footprint::Footprint;
use super::groups::middle;
use super::search::PlanarMotion;

/// A motion is believed whose score reaches the first and exceeds that of rest by the second.
pub const SCORE_MIN: f64 = 0.45;
const SCORE_GAIN: f64 = 0.2;
/// Bodies with a gap of at most the first (metres: the beams of a LiDAR graze the side of a car 1 m apart at 20 m) are
/// one body where that costs at most the second of the score.
pub const UNITE_GAP: f64 = 3.0;
pub const UNITE_LOSS: f64 = 0.1;
/// Difference of velocities, metres per second and as a share, up to which a body of another sweep confirms one.
const CONFIRM: [f64; 2] = [1.0, 0.15];
/// Distance between the rectangle around a body's moved points and the points of the one that confirms it, metres: of
/// two sweeps the earlier shows the back of a car to have moved and the later its front.
const CONFIRM_DISTANCE: f64 = 2.5;

/// A body of a sweep before its points are known.
#[derive(Clone)]
pub struct Candidate {
    /// The sweep of the body.
    pub sweep: usize,
    /// Evident points.
    pub evident: Vec<[f64; 2]>,
    /// The motion about the middle of the evident points.
    pub motion: PlanarMotion,
    /// Score of the motion, 0 to 1.
    pub score: f64,
    /// Whether the motion explains the points better than rest does.
    pub moves: bool,
}

impl Candidate {
    /// Takes the points of a group over; the motion stays, about the new middle.
    pub fn join(&mut self, group: Self) {
        self.evident.extend(group.evident);
        let centre = middle(&self.evident);
        self.motion = PlanarMotion { centre, velocity: self.motion.at(centre).0, ..self.motion };
    }
}

/// Whether points with the score of a motion and that of rest move.
pub fn is_motion(score: f64, resting: f64) -> bool {
    score >= SCORE_MIN && score >= resting + SCORE_GAIN
}

/// Whether a body moves as a body followed from another sweep would, whose points would be in `footprint`.
pub fn confirms(body: &Candidate, expected: &PlanarMotion, footprint: &Footprint) -> bool {
    let difference = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]);
    difference(body.motion.velocity, expected.velocity) <= CONFIRM[0] + CONFIRM[1] * expected.speed()
        && body.evident.iter().any(|point| footprint.contains(*point, [CONFIRM_DISTANCE; 2]))
}
