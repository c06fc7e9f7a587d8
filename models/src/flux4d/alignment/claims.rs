//! The points that belong to each body.

use rayon::prelude::*;

use super::aligned::Aligned;
use super::candidate::is_motion;
use super::footprint::Footprint;
use super::in_plan;
use super::search::PlanarMotion;
use super::sweeps::Snippet;
use super::tracks::Track;

/// Heights of the points that belong to a body once it is found: from its wheels to the roof of a lorry. The road
/// under a car is within 0.2 m of the ground around it.
pub(super) const OWN_HEIGHTS: [f32; 2] = [0.15, 4.5];
/// Room around a body's evident points in which points belong to it, metres.
const MARGIN: f64 = 0.35;
/// Room in which points belong to it that move rather than rest, along and across its motion, metres: what is evident
/// of a car may be its back alone.
const AROUND: [f64; 2] = [3.0, 1.5];
/// Closeness that a point must have to belong to a body, and what of it the point may lose against rest: the sides of a
/// car fit rest as well, a parked car beside it does better at rest.
const OWN_CLOSENESS: f64 = 0.3;
const OWN_LOSS: f64 = 0.1;

impl Snippet<'_> {
    /// Gives those of the points looked at that have no body to the bodies of a finer scale, where their motion
    /// explains them.
    ///
    /// By itself what is left of such a body fits many motions.
    pub fn complete(&self, found: &mut Aligned) {
        for (sweep, among) in self.among.iter().enumerate() {
            let others = self.others(sweep);
            let bodies = &found.bodies[sweep];
            let mut own = vec![Vec::new(); bodies.len()];
            for (point, body) in found.of_point[sweep].iter().enumerate() {
                if let Some(body) = body {
                    own[*body as usize].push(in_plan(&self.seen.sweeps[sweep].points[point]));
                }
            }
            let boxes = bodies.iter().zip(own).map(|(body, own)| Footprint::of(body.velocity, own.into_iter()));
            let boxes: Vec<Footprint> = boxes.collect();
            let of_point = |point: &usize| {
                let at = in_plan(&self.seen.sweeps[sweep].points[*point]);
                let near = (0..boxes.len()).filter(|body| boxes[*body].contains(at, AROUND));
                let fits = near.map(|body| (self.score(&[at], &bodies[body], &others), body));
                let best = fits.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(score, _)| *score >= OWN_CLOSENESS);
                (*point, best.map(|(_, body)| body as u32))
            };
            let more: Vec<(usize, Option<u32>)> =
                among.par_iter().filter(|point| found.of_point[sweep][**point].is_none()).map(of_point).collect();
            more.into_iter().for_each(|(point, body)| found.of_point[sweep][point] = body);
        }
    }

    /// Gives the points near each body to it, in every sweep.
    pub fn claimed(&self, tracks: Vec<Track>) -> Aligned {
        let boxes: Vec<Vec<Footprint>> = tracks.iter().map(|track| track.footprints(self)).collect();
        let of_sweep = |sweep| self.claimed_in(sweep, &tracks, &boxes);
        let (bodies, of_point) = (0..self.seen.sweeps.len()).map(of_sweep).unzip();
        Aligned { bodies, of_point, ..Aligned::default() }
    }

    /// The motions of the bodies at the time of a sweep, and the body of each of its points.
    fn claimed_in(
        &self,
        sweep: usize,
        tracks: &[Track],
        boxes: &[Vec<Footprint>],
    ) -> (Vec<PlanarMotion>, Vec<Option<u32>>) {
        let seen = self.seen;
        let motions: Vec<PlanarMotion> = tracks.iter().map(|track| track.at(self, sweep)).collect();
        let others = self.others(sweep);
        let whole = self.before.as_ref().map_or(self, |before| before.snippet);
        let resting = whole.others(sweep);
        let of_point = |index: usize| {
            let height = seen.heights[sweep][index];
            let is_taken = self.before.as_ref().is_some_and(|before| before.found.of_point[sweep][index].is_some());
            if is_taken || !(OWN_HEIGHTS[0]..OWN_HEIGHTS[1]).contains(&height) {
                return None;
            }
            let at = in_plan(&seen.sweeps[sweep].points[index]);
            let fit = |body: usize| {
                let motion = &motions[body];
                let moving = self.score(&[at], motion, &others);
                let rest = self.score(&[at], &PlanarMotion::rest(motion.time, at), &resting);
                let fits = if boxes[body][sweep].contains(at, [MARGIN; 2]) {
                    moving >= OWN_CLOSENESS && moving >= rest - OWN_LOSS
                } else {
                    is_motion(moving, rest)
                };
                (fits && !whole.rests(at, sweep, &boxes[body])).then_some((moving, body))
            };
            let near = (0..tracks.len()).filter(|body| boxes[*body][sweep].contains(at, AROUND));
            near.filter_map(fit).max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, body)| body as u32)
        };
        let of_point = (0..seen.sweeps[sweep].points.len()).into_par_iter().map(of_point).collect();
        (motions, of_point)
    }
}
