//! Judgements of poses in sentences, with the key that reads the data otherwise.

use gs_base::counted;

use crate::poses::{Evidence, PointsFault, PoseJudgement, PoseVerdict};

impl Evidence {
    /// The evidence in words; `None` where there is none.
    fn described(self) -> Option<String> {
        let percent = |share: f64| format!("{:.0} %", 100.0 * share);
        let matches = self.matches.map(|share| format!("{} of the matched corners fit", percent(share)));
        let points = self.points.map(|points| {
            let colors = points.agreement.map_or_else(String::new, |r| format!(", colours correlate by {r:.2}"));
            format!("{} of the points are in view{colors}", percent(points.seen))
        });
        let outlines = self.outlines.map(|share| format!("{} of the outlines meet", percent(share)));
        let parts: Vec<String> = matches.into_iter().chain(points).chain(outlines).collect();
        (!parts.is_empty()).then(|| parts.join(", "))
    }
}

impl PoseJudgement {
    /// The evidence for the poses as they were read, a sentence.
    pub fn fact(&self) -> String {
        let read = self.read;
        let Some(described) = self.given.described() else {
            return format!(
                "Poses, read as {read}, could not be judged: photos share too few corners, and there are neither \
                 points nor outlines."
            );
        };
        let (matches, pairs) = self.matched;
        let of = if matches > 0 {
            format!(" ({} in {} of photos)", counted(matches, "corner"), counted(pairs, "pair"))
        } else {
            String::new()
        };
        let untold = if self.verdict == PoseVerdict::Untold { "; that is too little to judge by" } else { "" };
        format!("Poses against photos, read as {read}: {described}{of}{untold}.")
    }

    /// The fault of poses or points, if there is one, and the way out; `is_open`: nobody says how poses are meant, so
    /// that a training reads them in the convention that photos speak for.
    pub fn warning(&self, is_open: bool) -> Option<String> {
        let given = self.given.described().unwrap_or_default();
        let read = self.read;
        let points = self.points.map(|fault| fault.sentence(&given));
        Some(match self.verdict {
            PoseVerdict::Agrees | PoseVerdict::Untold => return points,
            PoseVerdict::Convention(other, found) => format!(
                "the poses seem to be of another convention: read as {read}, {given}; read as {other}, {}; \
                 {}data.poses={other} reads them so",
                found.described().unwrap_or_default(),
                if is_open { "a training does that, and " } else { "" }
            ),
            PoseVerdict::Disagrees => format!(
                "photos agree with each other and not with their poses ({given}), and no usual convention explains \
                 that; do the poses belong to these photos, in this order?"
            ),
            PoseVerdict::LooksAway(other) => format!(
                "all cameras look away from where their axes meet: right for photos taken outward from one place; \
                 otherwise data.poses={other} turns them round, or another value of data.poses is right"
            ),
        })
    }
}

impl PointsFault {
    fn sentence(self, given: &str) -> String {
        match self {
            Self::Scale(scale, found) => format!(
                "the points seem to be in another unit than the poses: as they are, {given}; multiplied by {scale:.4}, \
                 {}; data.points_scale={scale:.4} does that",
                found.described().unwrap_or_default()
            ),
            Self::Unseen => format!(
                "hardly any point lies before a camera and inside its photo ({given}), and no usual convention or unit \
                 explains that; are points and poses of one world? data.poses and data.points_scale say how they are \
                 meant"
            ),
            Self::Distant(times) => format!(
                "the points lie {times:.0} times as far from the cameras as these from each other; are points and \
                 poses of one world, with one origin?"
            ),
            Self::Colors => format!(
                "the points do not have the colours that photos show where they lie ({given}): they are of another \
                 world than the poses, or random; a set without its point file begins where photos agree"
            ),
        }
    }
}
