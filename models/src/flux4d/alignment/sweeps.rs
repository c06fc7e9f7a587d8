//! The sweeps in which bodies are looked for, and how well a motion explains points of one by the others.

use rayon::prelude::*;

use super::AlignedSweep;
use super::aligned::Aligned;
use super::clock::Clock;
use super::evidence::places;
use super::plan::{Extent, Plan};
use super::search::{Other, PlanarMotion, score};
use super::shadow::Shadow;

/// The scale at which bodies are looked for.
pub struct Scale {
    /// Distance up to which a place counts as near a point, metres.
    pub reach: f64,
    /// Edge of the cells by which points are joined, metres.
    pub join: f64,
    /// Fewest evident points of a body in a sweep.
    pub fewest: usize,
    /// Share of the other sweeps that need not count, the worst ones: what is hidden is not known for sure.
    pub unsure: f64,
    /// Whether velocities may change.
    pub bends: bool,
}

/// Bodies with a surface. The reach is two steps of a spinning LiDAR at 50 m, and the change of the visible side of a
/// car between sweeps; a person at 40 m has five points.
pub const FINE: Scale = Scale { reach: 0.4, join: 0.3, fewest: 5, unsure: 0.34, bends: true };
/// Bodies of a few beams, which meet the bumper in one sweep and the window 1.4 m behind it in another. Their places
/// are too vague for a change of velocity.
pub const COARSE: Scale = Scale { reach: 1.2, join: 0.75, fewest: 3, unsure: 0.5, bends: false };

/// All sweeps, and what is known of each.
#[derive(Clone, Copy)]
pub struct Seen<'a> {
    /// All of them.
    pub sweeps: &'a [AlignedSweep<'a>],
    /// Extent of all points above the ground, metres.
    pub heights: &'a [Vec<f32>],
    /// When each looks where.
    pub clocks: &'a [Clock],
    /// How much each counts where sweeps are counted: those of LiDARs that look at one time together count once,
    /// because all of them would meet another body there.
    pub weights: &'a [f32],
    /// The places that each does not see.
    pub shadows: &'a [Shadow],
}

/// The sweeps in which all bodies of a scale are looked for.
pub struct Snippet<'a> {
    /// The sweeps.
    pub seen: Seen<'a>,
    /// The scale at which bodies are looked for.
    pub scale: Scale,
    /// The points of each sweep between which bodies are looked for.
    pub among: &'a [Vec<usize>],
    /// Of these points.
    pub plans: Vec<Plan>,
    /// The bodies found before.
    pub before: Option<Before<'a>>,
}

/// Bodies of a finer scale.
pub struct Before<'a> {
    /// Its plans show all standing points, by which what rests is known.
    pub snippet: &'a Snippet<'a>,
    /// Points that belong to a body keep it.
    pub found: &'a Aligned,
}

impl<'a> Snippet<'a> {
    /// At a scale in plans of an extent; bodies are looked for between the points `among` of each sweep.
    pub fn new(seen: Seen<'a>, (scale, extent): (Scale, Extent), among: &'a [Vec<usize>]) -> Self {
        let plan = |(sweep, among): (&AlignedSweep, &Vec<usize>)| Plan::new(places(sweep, among), extent, scale.reach);
        let plans = seen.sweeps.par_iter().zip(among).map(plan).collect();
        Self { seen, scale, among, plans, before: None }
    }

    /// The other sweeps that show motion since one or until then, the nearest in time first.
    pub fn others(&self, sweep: usize) -> Vec<Other<'_>> {
        let Seen { sweeps, clocks, shadows, .. } = self.seen;
        let shows = |other: &usize| clocks[*other].is_apart(&clocks[sweep]) && !sweeps[*other].points.is_empty();
        let other = |index: usize| Other { plan: &self.plans[index], shadow: &shadows[index], clock: &clocks[index] };
        let mut others: Vec<Other> = (0..sweeps.len()).filter(shows).map(other).collect();
        let apart = |other: &Other| (other.clock.middle() - clocks[sweep].middle()).abs();
        others.sort_by(|a, b| apart(a).total_cmp(&apart(b)));
        others
    }

    /// How well a motion explains points of a sweep to the `others`, 0 to 1.
    pub fn score(&self, points: &[[f64; 2]], motion: &PlanarMotion, others: &[Other]) -> f64 {
        score(self.scale.unsure, points, motion, others)
    }
}
