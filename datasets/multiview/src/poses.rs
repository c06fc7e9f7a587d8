//! Whether poses agree with what photos and points say, and in which other convention they would.
//!
//! Nothing in a file tells whether its matrices lead to the world or from it, or where its camera looks. The data do:
//! patches that two photos share lie on each other's epipolar lines, and coloured points project onto their colours.

use glam::{DMat4, DVec3};

use gs_datasets::{PointCloud, PoseConvention, View, mirrored, nearest_to_axes};

use crate::pose_evidence::{Matches, Outlines, PointEvidence, Points};

/// Most pairs of views that are matched: of neighbours by name, and of neighbours by position.
const PAIRS: [usize; 2] = [8, 8];

/// Least share of explained matches at which poses agree with photos: the rest is chance, lens and motion.
const AGREES: f64 = 0.5;

/// Least lead of another convention over the one that was read. Sound sets have a share of 0.95 and more; a wrong
/// convention explains up to 0.45 by chance where cameras moved along a line.
const LEAD: f64 = 0.35;

/// Fewest matches and pairs by which poses are called wrong though no other convention explains them.
const SURE: (usize, usize) = (100, 4);

/// Shares of outlines whose middles meet: fewer than the first disagree, the second and more agree.
const OUTLINES: (f64, f64) = (0.5, 0.8);

/// Least correlation of points' colours with photos at which they agree, and its least lead over that of the poses as
/// they were read. Hidden points, shadows and gloss take from it: sound sets have 0.5 to 0.95.
const COLORS: (f64, f64) = (0.45, 0.3);

/// Correlation below which points' colours are not those of the photos: sound sets have 0.49 and more.
const COLORS_DIFFER: f64 = 0.3;

/// Distance of points in distances between cameras at which they are of another world: far scenery of a short walk ends
/// before.
const DISTANT: f64 = 1000.0;

/// Shares of points in view: fewer than the first are as good as none; an explanation shows at least the second.
const SEEN: (f64, f64) = (0.05, 0.5);

/// Factors between units that are confused: millimetres, centimetres, inches, feet and metres.
const UNITS: [f64; 10] = [1e-3, 1e3, 1e-2, 1e2, 0.1, 10.0, 0.0254, 1.0 / 0.0254, 0.3048, 1.0 / 0.3048];

/// Least determinant of axes that meet, see [`nearest_to_axes`], and the largest angle of an axis from where they do,
/// radians.
const MEETING: (f64, f64) = (0.005, 0.5);

/// A camera as far as pairs are chosen by it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Camera to world.
    pub c2w: DMat4,
    /// Time of the photo.
    pub time: Option<f64>,
}

/// Views to look at, and pairs of them to match.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PosePairs {
    /// Indices of cameras, ascending.
    pub views: Vec<usize>,
    /// Pairs of indices into `views`.
    pub pairs: Vec<[usize; 2]>,
}

/// Agreement of poses in one convention.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// Share of matched patches that lie on each other's epipolar lines before both cameras, 0 to 1; `None` where few
    /// were found.
    pub matches: Option<f64>,
    /// Points; `None` without any.
    pub points: Option<PointEvidence>,
    /// Share of the object's outlines whose middles meet before all cameras, 0 to 1; `None` where photos have no
    /// transparent background.
    pub outlines: Option<f64>,
}

/// The judgement of [`judge_poses`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PoseVerdict {
    /// Photos and points agree with the poses, as far as they tell.
    Agrees,
    /// The data do not tell.
    Untold,
    /// In this convention they would agree.
    Convention(PoseConvention, Evidence),
    /// Photos agree with each other and not with the poses in any convention.
    Disagrees,
    /// All cameras look away from where their axes meet; in this convention they look there.
    LooksAway(PoseConvention),
}

/// A fault of points beside poses that nothing speaks against.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PointsFault {
    /// They would agree with the photos if they were multiplied by this factor.
    Scale(f64, Evidence),
    /// No view has them before it.
    Unseen,
    /// They lie this many times as far away as the cameras lie from each other.
    Distant(f64),
    /// Their colours are not those of the photos where they are seen.
    Colors,
}

/// The judgement of poses by photos and points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseJudgement {
    /// The convention as which poses were read.
    pub read: PoseConvention,
    /// Agreement in that convention.
    pub given: Evidence,
    /// Matched patches, and the pairs of views that they are of.
    pub matched: (usize, usize),
    /// The judgement of the poses.
    pub verdict: PoseVerdict,
    /// The judgement of the points; `None` where nothing is wrong with them.
    pub points: Option<PointsFault>,
}

/// Pairs of different poses for [`judge_poses`]: of one moment if any moment has three views, otherwise of all.
pub fn pose_pairs(cameras: &[Camera]) -> PosePairs {
    let chosen = of_one_moment(cameras);
    let differ = |[a, b]: &[usize; 2]| !cameras[*a].c2w.abs_diff_eq(cameras[*b].c2w, 1e-9);
    let in_order = chosen.windows(2).map(|pair| [pair[0], pair[1]]).filter(differ);
    let mut pairs = evenly(in_order.collect(), PAIRS[0]);
    let nearest = evenly(chosen.clone(), PAIRS[1]).into_iter().filter_map(|a| {
        let distance = |b: &usize| cameras[a].c2w.w_axis.distance(cameras[*b].c2w.w_axis);
        let others = chosen.iter().copied().filter(|b| differ(&[a, *b]));
        others.min_by(|b, c| distance(b).total_cmp(&distance(c))).map(|b| [a.min(b), a.max(b)])
    });
    pairs.extend(nearest);
    pairs.sort_unstable();
    pairs.dedup();
    let mut views = pairs.concat();
    views.sort_unstable();
    views.dedup();
    if views.is_empty() {
        // One camera, or one pose: its points can still be looked at.
        views = evenly(chosen, PAIRS[0]);
    }
    let place = |view: usize| views.binary_search(&view).unwrap_or_default();
    let pairs = pairs.into_iter().map(|pair| pair.map(place)).collect();
    PosePairs { views, pairs }
}

/// The cameras of the moment with the most, if it has three; otherwise all.
fn of_one_moment(cameras: &[Camera]) -> Vec<usize> {
    let mut moments: std::collections::BTreeMap<u64, Vec<usize>> = std::collections::BTreeMap::new();
    for (i, camera) in cameras.iter().enumerate() {
        if let Some(time) = camera.time {
            moments.entry(time.to_bits()).or_default().push(i);
        }
    }
    // The first of the fullest, of times from 0 on: points that move are of the first moment.
    let fullest = moments.into_values().rev().max_by_key(Vec::len).filter(|cameras| cameras.len() >= 3);
    fullest.unwrap_or_else(|| (0..cameras.len()).collect())
}

/// At most `count` of a list, evenly through it.
fn evenly<T>(list: Vec<T>, count: usize) -> Vec<T> {
    let (length, step) = (list.len(), list.len().div_ceil(count).max(1));
    list.into_iter().enumerate().filter(|(i, _)| length <= count || i % step == 0).map(|(_, value)| value).collect()
}

/// Judges the poses of `views` by the photos of `pairs` of them and by `points`. `origin` was subtracted from
/// positions; `read` is the convention as which the poses were read.
pub fn judge_poses(
    views: &[&View],
    pairs: &[[usize; 2]],
    points: Option<&PointCloud>,
    origin: DVec3,
    read: PoseConvention,
) -> PoseJudgement {
    let data = Data {
        views,
        matches: Matches::of(views, pairs),
        points: Points::of(points, origin),
        outlines: Outlines::of(views),
        origin,
        read,
    };
    let given = data.evidence(read, 1.0);
    let matched = data.matches.as_ref().map_or((0, 0), |matches| (matches.count(), matches.pairs()));
    let verdict = data.verdict(given);
    // Beside wrong poses nothing can be said of points.
    let sound = matches!(verdict, PoseVerdict::Agrees | PoseVerdict::Untold);
    let points = if sound { data.points_fault(given) } else { None };
    PoseJudgement { read, given, matched, verdict, points }
}

/// Everything that poses are judged by.
struct Data<'a> {
    views: &'a [&'a View],
    matches: Option<Matches>,
    points: Option<Points>,
    outlines: Option<Outlines>,
    origin: DVec3,
    read: PoseConvention,
}

impl Data<'_> {
    /// Poses in the file's world (camera to world, OpenCV axes) if the file is of this convention.
    fn poses(&self, convention: PoseConvention) -> Vec<DMat4> {
        let of = |view: &&View| {
            let c2w = DMat4::from_translation(self.origin) * view.c2w;
            if convention == self.read { c2w } else { convention.to_c2w(self.read.to_file(c2w)) }
        };
        self.views.iter().map(of).collect()
    }

    fn evidence(&self, convention: PoseConvention, scale: f64) -> Evidence {
        let poses = self.poses(convention);
        let is_mirrored = convention.mirrors(self.read.to_file(DMat4::IDENTITY));
        let scale = if is_mirrored { mirrored(DVec3::splat(scale)) } else { DVec3::splat(scale) };
        Evidence {
            matches: self.matches.as_ref().map(|matches| matches.explained(&poses)),
            points: self.points.as_ref().map(|points| points.evidence(self.views, &poses, scale)),
            outlines: self.outlines.as_ref().map(|outlines| outlines.explained(&poses)),
        }
    }

    fn verdict(&self, given: Evidence) -> PoseVerdict {
        let is_sure = self.matches.as_ref().is_some_and(|found| found.count() >= SURE.0 && found.pairs() >= SURE.1);
        let outlines_agree = given.outlines.is_some_and(|share| share >= OUTLINES.1);
        match given.matches {
            Some(share) if share >= AGREES => PoseVerdict::Agrees,
            // Colours of points correlate a little in any order of photos of one place, so sure matches come before
            // them.
            Some(_) if is_sure => self.other_convention(given).unwrap_or(PoseVerdict::Disagrees),
            _ if given.points_agree() => PoseVerdict::Agrees,
            _ => match self.other_convention(given) {
                Some(better) => better,
                None if outlines_agree => PoseVerdict::Agrees,
                None => self.looks_away().map_or(PoseVerdict::Untold, PoseVerdict::LooksAway),
            },
        }
    }

    fn points_fault(&self, given: Evidence) -> Option<PointsFault> {
        let seen = given.points?.seen;
        if given.points_agree() {
            return None;
        }
        if let Some(scaled) = self.other_unit(given) {
            return Some(scaled);
        }
        let distance = self.points.as_ref().map_or(0.0, |points| points.distance(&self.poses(self.read)));
        match given.agreement() {
            _ if distance > DISTANT => Some(PointsFault::Distant(distance)),
            _ if seen < SEEN.0 => Some(PointsFault::Unseen),
            Some(r) if r < COLORS_DIFFER => Some(PointsFault::Colors),
            _ => None,
        }
    }

    /// The convention that the data speak for, if they speak against the given one.
    fn other_convention(&self, given: Evidence) -> Option<PoseVerdict> {
        let others = PoseConvention::all().into_iter().filter(|other| *other != self.read);
        let explains = others.map(|other| (other, self.evidence(other, 1.0))).filter(|(_, found)| found.beats(given));
        // The first of equals, which is the more usual one.
        let mut best: Option<(PoseConvention, Evidence)> = None;
        for (other, found) in explains {
            if best.is_none_or(|(_, known)| found.weight() > known.weight() + 1e-9) {
                best = Some((other, found));
            }
        }
        best.map(|(other, found)| PoseVerdict::Convention(other, found))
    }

    /// The unit that the points' colours speak for.
    fn other_unit(&self, given: Evidence) -> Option<PointsFault> {
        let scaled = UNITS.into_iter().map(|scale| (scale, self.evidence(self.read, scale)));
        let explains = scaled.filter(|(_, found)| found.points_beat(given));
        let best = explains.max_by(|a, b| a.1.weight().total_cmp(&b.1.weight()));
        best.map(|(scale, found)| PointsFault::Scale(scale, found))
    }

    /// The convention with its camera looking the other way, where all cameras have behind them what their axes meet
    /// in.
    fn looks_away(&self) -> Option<PoseConvention> {
        let poses = self.poses(self.read);
        let meeting = nearest_to_axes(&poses, MEETING.0).filter(|_| poses.len() >= 3)?;
        let away = |pose: &DMat4| {
            let from = pose.w_axis.truncate() - meeting;
            from.length() > 0.0 && from.angle_between(pose.z_axis.truncate()) < MEETING.1
        };
        // The same file, its camera's y and z axes negated.
        let turned = |convention: &PoseConvention| {
            let turn = DMat4::from_cols(glam::DVec4::X, glam::DVec4::NEG_Y, glam::DVec4::NEG_Z, glam::DVec4::W);
            let pose = poses.first().copied().unwrap_or(DMat4::IDENTITY);
            convention.to_c2w(self.read.to_file(pose)).abs_diff_eq(pose * turn, 1e-9 * pose.w_axis.length())
        };
        let all_away = poses.iter().all(away);
        PoseConvention::all()
            .into_iter()
            .find(|other| all_away && other.world_to_camera == self.read.world_to_camera && turned(other))
    }
}

impl Evidence {
    fn agreement(self) -> Option<f64> {
        self.points.and_then(|points| points.agreement)
    }

    fn points_agree(self) -> bool {
        self.points.is_some_and(|points| points.seen >= SEEN.1) && self.agreement().is_some_and(|r| r >= COLORS.0)
    }

    /// Whether points speak for this and against the given.
    fn points_beat(self, given: Self) -> bool {
        let lead = || self.agreement().unwrap_or(0.0) - given.agreement().unwrap_or(0.0);
        self.points_agree() && lead() >= COLORS.1
    }

    /// Whether the data speak for this and against the given.
    fn beats(self, given: Self) -> bool {
        match (self.matches, given.matches, self.outlines, given.outlines) {
            (Some(share), Some(before), ..) => share >= AGREES && share - before >= LEAD,
            (.., Some(share), Some(before)) if self.points.is_none() => share >= OUTLINES.1 && before < OUTLINES.0,
            _ => self.points_beat(given),
        }
    }

    fn weight(self) -> f64 {
        self.matches.unwrap_or(0.0) + self.agreement().unwrap_or(0.0).max(0.0) + self.outlines.unwrap_or(0.0)
    }
}
