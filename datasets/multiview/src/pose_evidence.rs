//! Agreement of poses with photos: matched patches lie on each other's epipolar lines, points project onto their
//! colours, and rays through the middles of an object's outlines meet.

use glam::{DMat3, DMat4, DVec3, Vec3};
use gs_base::statistics::median_by;
use rayon::prelude::*;

use gs_datasets::{PointCloud, View, nearest_to_axes};

use crate::grey::Grey;
use crate::matches::{Corners, WIDTH};
use crate::pinhole::Pinhole;
use crate::pixels::{color, counts};

/// Largest distance of a match from its epipolar line, pixels of a photo of [`WIDTH`]: corners are whole pixels, and
/// poses may be some off.
const TOLERANCE: f64 = 2.5;

/// Fewest supported matches of a pair whose share means something.
const PAIR_MATCHES: usize = 8;

/// Fewest pairs and fewest matches in all. Of one pair alone, several conventions may explain the matches.
const FEWEST: (usize, usize) = (2, 40);

/// Most points that are looked at, evenly through the list.
const POINTS: usize = 400;

/// Most points, evenly through the list, that may hide others.
const HIDING: usize = 20_000;

/// Cells of a photo's longer side in which the nearest point hides those behind it. So many points of a surface leave
/// hardly a cell of it empty.
const CELLS: usize = 64;

/// A point is hidden that is further away than the nearest of its cell by more than this share.
const BEHIND: f64 = 0.05;

/// Fewest projections of points onto photos whose colours mean something.
const SAMPLES: usize = 100;

/// Smallest standard deviation of the points' colours, levels of 255: grey points agree with any photo.
const COLORED: f64 = 4.0;

/// Shares of a photo that an object's outline has at the least and at the most.
const OUTLINE: [f64; 2] = [0.002, 0.6];

/// Largest angle between the ray through an outline's middle and where all rays meet, radians: an object looks
/// different from each side.
const MIDDLE: f64 = 0.1;

/// Least determinant of rays that meet, see [`nearest_to_axes`], and the least share of the median distance at which a
/// camera stands.
const MEETING: (f64, f64) = (0.005, 0.1);

/// Supported matches of one pair of views.
struct PairMatches {
    views: [usize; 2],
    /// Unit rays in each camera's OpenCV axes.
    rays: Vec<[DVec3; 2]>,
    /// [`TOLERANCE`] as an angle, radians.
    tolerance: f64,
}

/// Matches of several pairs.
pub(crate) struct Matches(Vec<PairMatches>);

impl Matches {
    /// The matches of `pairs` of `views`; `None` where too few are found to judge by.
    pub fn of(views: &[&View], pairs: &[[usize; 2]]) -> Option<Self> {
        let greys: Vec<Grey> = views.par_iter().map(|view| Grey::of(view, WIDTH)).collect();
        let corners: Vec<Corners> =
            (&greys, views).into_par_iter().map(|(grey, view)| Corners::of(grey, view)).collect();
        let of = |pair: &[usize; 2]| {
            let cameras = pair.map(|view| &greys[view].intrinsics);
            let ray = |side: usize, at: glam::DVec2| cameras[side].ray(at.x, at.y).normalize();
            let found = corners[pair[0]].matches(&corners[pair[1]]);
            let rays = found.into_iter().map(|[a, b]| [ray(0, a), ray(1, b)]).collect();
            PairMatches { views: *pair, rays, tolerance: TOLERANCE / cameras[0].fx.max(cameras[0].fy) }
        };
        let all: Vec<PairMatches> = pairs.par_iter().map(of).filter(|pair| pair.rays.len() >= PAIR_MATCHES).collect();
        let found = Self(all);
        (found.pairs() >= FEWEST.0 && found.count() >= FEWEST.1).then_some(found)
    }

    /// Pairs with enough matches.
    pub fn pairs(&self) -> usize {
        self.0.len()
    }

    /// Matches of all pairs.
    pub fn count(&self) -> usize {
        self.0.iter().map(|pair| pair.rays.len()).sum()
    }

    /// The share of a pair's matches that poses (camera to world, OpenCV axes) explain, in the mean of all pairs, 0 to
    /// 1.
    pub fn explained(&self, poses: &[DMat4]) -> f64 {
        let share = |pair: &PairMatches| {
            let [a, b] = pair.views.map(|view| poses[view]);
            let second_to_first = a.inverse() * b;
            let fits = pair.rays.iter().filter(|rays| fits(second_to_first, **rays, pair.tolerance)).count();
            fits as f64 / pair.rays.len() as f64
        };
        self.0.iter().map(share).sum::<f64>() / self.pairs() as f64
    }
}

/// Whether two rays meet before both cameras, up to an angle. `second_to_first` leads from the second camera's axes to
/// the first's.
fn fits(second_to_first: DMat4, [a, b]: [DVec3; 2], tolerance: f64) -> bool {
    let (b, apart) = (DMat3::from_mat4(second_to_first) * b, second_to_first.w_axis.truncate());
    let across = a.cross(b);
    if across.length() <= tolerance {
        // So far away that the rays are parallel.
        return a.dot(b) > 0.0;
    }
    let normal = apart.cross(b).normalize_or_zero();
    if normal == DVec3::ZERO || a.dot(normal).abs() > tolerance {
        return false;
    }
    // a s = apart + b t, each multiplied across the other ray.
    let (s, t) = (apart.cross(b).dot(across), apart.cross(a).dot(across));
    s > 0.0 && t > 0.0
}

/// Rays through the middles of an object's outlines, in photos with a transparent background.
pub(crate) struct Outlines(Vec<DVec3>);

impl Outlines {
    /// The outlines in the photos' alpha; `None` where there are fewer than three, or a photo has none.
    pub fn of(views: &[&View]) -> Option<Self> {
        let rays: Option<Vec<DVec3>> = views.iter().map(|view| middle_ray(view)).collect();
        rays.filter(|rays| rays.len() >= 3).map(Self)
    }

    /// The share of rays that have before them where all meet, 0 to 1, by poses (camera to world, OpenCV axes).
    pub fn explained(&self, poses: &[DMat4]) -> f64 {
        let turned = |(pose, ray): (&DMat4, &DVec3)| {
            let mut along = *pose;
            along.z_axis = pose.transform_vector3(*ray).extend(0.0);
            along
        };
        let rays: Vec<DMat4> = poses.iter().zip(&self.0).map(turned).collect();
        let Some(meeting) = nearest_to_axes(&rays, MEETING.0) else { return 0.0 };
        let to = |ray: &DMat4| meeting - ray.w_axis.truncate();
        let mut distances: Vec<f64> = rays.iter().map(|ray| to(ray).length()).collect();
        distances.sort_by(f64::total_cmp);
        // Rays from one place meet there, and say nothing.
        let spread = rays.iter().map(|ray| ray.w_axis.distance(rays[0].w_axis)).fold(0.0, f64::max);
        let nearest = MEETING.1 * distances[distances.len() / 2].max(spread);
        let meets = |ray: &&DMat4| to(ray).length() > nearest && to(ray).angle_between(ray.z_axis.truncate()) < MIDDLE;
        rays.iter().filter(meets).count() as f64 / rays.len() as f64
    }
}

/// The unit ray, in OpenCV axes, through the mean of a photo's opaque pixels; `None` where they are no outline.
fn middle_ray(view: &View) -> Option<DVec3> {
    let alpha = view.alpha.as_ref()?;
    let (mut sum, mut count) = (glam::DVec2::ZERO, 0usize);
    for (pixel, _) in alpha.iter().enumerate().filter(|(_, alpha)| **alpha > u8::MAX / 2) {
        sum += glam::DVec2::new((pixel % view.width) as f64 + 0.5, (pixel / view.width) as f64 + 0.5);
        count += 1;
    }
    let share = count as f64 / alpha.len() as f64;
    let middle = sum / count as f64;
    (OUTLINE[0]..=OUTLINE[1]).contains(&share).then(|| view.intrinsics.ray(middle.x, middle.y).normalize())
}

/// Points as poses show them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointEvidence {
    /// Share of the points that at least one view has before it and inside, 0 to 1.
    pub seen: f64,
    /// Correlation of the points' colours with the pixels that they project to, -1 to 1; `None` where few are seen or
    /// all have one colour.
    pub agreement: Option<f64>,
}

/// Points, evenly chosen, in the world of a file.
pub(crate) struct Points {
    positions: Vec<DVec3>,
    colors: Vec<[u8; 3]>,
    /// Points that may hide these.
    hiding: Vec<DVec3>,
}

impl Points {
    /// Some of `points`, with `origin` added; `None` without points.
    pub fn of(points: Option<&PointCloud>, origin: DVec3) -> Option<Self> {
        let points = points.filter(|points| !points.is_empty())?;
        let step = points.len().div_ceil(POINTS);
        let every = |step: usize| -> Vec<DVec3> {
            points.positions.iter().step_by(step).map(|p| Vec3::from(*p).as_dvec3() + origin).collect()
        };
        let colors = points.colors.iter().step_by(step).copied().collect();
        Some(Self { positions: every(step), colors, hiding: every(points.len().div_ceil(HIDING)) })
    }

    /// The median distance of the points from the cameras' middle, in median distances of the cameras from it; 0 of
    /// cameras at one place.
    pub fn distance(&self, poses: &[DMat4]) -> f64 {
        let centres: Vec<DVec3> = poses.iter().map(|pose| pose.w_axis.truncate()).collect();
        let middle = centres.iter().sum::<DVec3>() / centres.len().max(1) as f64;
        let far = |positions: &[DVec3]| {
            let mut distances: Vec<f64> = positions.iter().map(|position| position.distance(middle)).collect();
            median_by(&mut distances, f64::total_cmp)
        };
        match (far(&self.positions), far(&centres)) {
            (Some(points), Some(cameras)) if cameras > 0.0 => points / cameras,
            _ => 0.0,
        }
    }

    /// The points, multiplied by `scale` along each axis, as poses (camera to world, OpenCV axes, in the file's world)
    /// show them.
    pub fn evidence(&self, views: &[&View], poses: &[DMat4], scale: DVec3) -> PointEvidence {
        let mut seen = vec![false; self.positions.len()];
        let mut pairs: Vec<([u8; 3], [u8; 3])> = Vec::new();
        for (view, pose) in views.iter().zip(poses) {
            let camera = Pinhole::posed(*pose, view.intrinsics, view.width, view.height);
            let cells = Cells::of(&camera, self.hiding.iter().map(|position| *position * scale));
            for (i, position) in self.positions.iter().enumerate() {
                let Some((pixel, depth)) = camera.sees(*position * scale) else { continue };
                seen[i] = true;
                if cells.hides(pixel, depth) {
                    continue;
                }
                if counts(view, pixel) && view.alpha.as_ref().is_none_or(|alpha| alpha[pixel] > u8::MAX / 2) {
                    pairs.push((self.colors[i], color(view, pixel)));
                }
            }
        }
        let count = seen.iter().filter(|seen| **seen).count();
        PointEvidence { seen: count as f64 / seen.len() as f64, agreement: correlation(&pairs) }
    }
}

/// The least depth of points in each cell of a photo.
struct Cells {
    width: usize,
    edge: usize,
    columns: usize,
    least: Vec<f64>,
}

impl Cells {
    fn of(camera: &Pinhole, points: impl Iterator<Item = DVec3>) -> Self {
        let edge = camera.width.max(camera.height).div_ceil(CELLS).max(1);
        let columns = camera.width.div_ceil(edge);
        let least = vec![f64::INFINITY; columns * camera.height.div_ceil(edge)];
        let mut cells = Self { width: camera.width, edge, columns, least };
        for (pixel, depth) in points.filter_map(|point| camera.sees(point)) {
            let cell = cells.cell(pixel);
            cells.least[cell] = cells.least[cell].min(depth);
        }
        cells
    }

    fn cell(&self, pixel: usize) -> usize {
        pixel / self.width / self.edge * self.columns + pixel % self.width / self.edge
    }

    fn hides(&self, pixel: usize, depth: f64) -> bool {
        depth > (1.0 + BEHIND) * self.least[self.cell(pixel)]
    }
}

/// The correlation of paired colours, each channel about its mean; `None` of few pairs, or where the first of all are
/// alike.
fn correlation(pairs: &[([u8; 3], [u8; 3])]) -> Option<f64> {
    let count = pairs.len() as f64;
    let (mut product, mut left, mut right) = (0.0, 0.0, 0.0);
    for channel in 0..3 {
        let values = pairs.iter().map(|(a, b)| (f64::from(a[channel]), f64::from(b[channel])));
        let (a, b) = values.clone().fold((0.0, 0.0), |sums, (a, b)| (sums.0 + a, sums.1 + b));
        let (a, b) = (a / count, b / count);
        for (x, y) in values {
            product += (x - a) * (y - b);
            left += (x - a).powi(2);
            right += (y - b).powi(2);
        }
    }
    let is_colored = left > 3.0 * count * COLORED.powi(2);
    (pairs.len() >= SAMPLES && is_colored && right > 0.0).then(|| product / (left * right).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two cameras a unit apart that look along z, and a point at depth 5.
    #[test]
    fn rays_meet_before_both_cameras() {
        let apart = DMat4::from_translation(DVec3::X);
        let rays = |point: DVec3| [point.normalize(), (point - DVec3::X).normalize()];
        let front = rays(DVec3::new(0.5, 0.2, 5.0));
        assert!(fits(apart, front, 0.01));
        assert!(!fits(apart, front.map(|ray| -ray), 0.01), "behind both");
        assert!(!fits(DMat4::from_translation(DVec3::NEG_X), front, 0.01), "the cameras changed places");
        assert!(!fits(apart, [front[0], (front[1] + DVec3::Y * 0.05).normalize()], 0.01), "off the line");
        assert!(fits(apart, [DVec3::Z, DVec3::Z], 0.01), "far away");
    }

    /// Cameras on an arc that look at the origin, and the same ones turned round.
    #[test]
    fn rays_of_outlines_meet_before_cameras() {
        let pose = |i: usize| {
            let turn = DMat4::from_rotation_y(0.4 * i as f64);
            turn * DMat4::from_translation(DVec3::new(0.0, 0.0, -4.0))
        };
        let outlines = Outlines(vec![DVec3::new(0.01, -0.02, 1.0).normalize(); 5]);
        let poses: Vec<DMat4> = (0..5).map(pose).collect();
        assert_eq!(outlines.explained(&poses), 1.0);
        let away: Vec<DMat4> = poses.iter().map(|pose| *pose * DMat4::from_rotation_x(std::f64::consts::PI)).collect();
        assert_eq!(outlines.explained(&away), 0.0);
        let one_place: Vec<DMat4> = poses.iter().map(|pose| DMat4::from_mat3(DMat3::from_mat4(*pose))).collect();
        assert_eq!(outlines.explained(&one_place), 0.0);
    }

    #[test]
    fn colours_correlate() {
        let level = |i: usize| [(i * 7 % 256) as u8, (i * 31 % 256) as u8, (i * 13 % 256) as u8];
        let pairs: Vec<_> = (0..500).map(|i| (level(i), level(i))).collect();
        assert!((correlation(&pairs).expect("coloured") - 1.0).abs() < 1e-12);
        let other: Vec<_> = (0..500).map(|i| (level(i), level(i + 1000))).collect();
        assert!(correlation(&other).expect("coloured").abs() < 0.3);
        assert_eq!(correlation(&[([5; 3], [9; 3]); 500]), None, "one colour");
        assert_eq!(correlation(&pairs[..50]), None, "few");
    }
}
