//! Where two views see the same surface: pixels of one view projected into others by depth and known cameras.

use glam::{DMat2, DVec2, DVec3};
use gs_base::median;
use rayon::prelude::*;

use super::view::MappedView;

/// Pixels of each view that are projected. Two unknowns a view need few; a thousand leave enough after occlusion and colour.
const SAMPLES: usize = 1500;

/// Other views that a view is compared with: those that look the same way from nearby.
const PARTNERS: usize = 6;

/// Known points that are looked at; a few hundred fall into each view.
const ANCHORS: usize = 20_000;

/// Share of the pixels of a view, the least sure, that are not projected.
const UNSURE: f64 = 0.2;

/// Depth changes between neighbours beyond this share are edges, where predicted depth is smeared.
const EDGE: f32 = 0.05;

/// Largest mean difference of colour, of 255, between two photos of one surface point. Shading and resizing of texture change it by 10 to
/// 20; two unrelated colours of a photo differ by 60 on average.
const COLOUR_MAX: f64 = 25.0;

/// Scale and shift of a view's depth: camera z is `scale * predicted + shift`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct DepthFit {
    pub scale: f64,
    pub shift: f64,
}

impl DepthFit {
    pub fn apply(self, depth: f64) -> f64 {
        self.scale * depth + self.shift
    }
}

/// A pixel that is compared.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    pub index: usize,
    pub depth: f64,
}

/// A sample of one view in another view.
#[derive(Debug, Clone, Copy)]
pub(super) struct Match {
    pub from: usize,
    pub to: usize,
    /// Predicted depth of the sample.
    pub depth: f64,
    /// Predicted depth of the other view there.
    pub other: f64,
    /// Camera z of the sample in the other view, scene units.
    pub z: f64,
    /// Change of that z, less the change of the other view's depth along the projection's path, for a change of the sample's own z.
    pub slope: f64,
    /// `(z - the other view's depth) / z`.
    pub residual: f64,
    /// Mean difference of the colours, of 255.
    pub colour: f64,
}

impl Match {
    /// Whether the photos show the same colour.
    pub fn agrees_in_colour(&self) -> bool {
        self.colour <= COLOUR_MAX
    }

    /// 1 for the same colour, down to 0 at [`COLOUR_MAX`].
    pub fn colour_weight(&self) -> f64 {
        colour_weight(self.colour)
    }
}

/// Mean difference over the channels, of 255.
fn colour_difference(a: [u8; 3], b: [u8; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| f64::from(a.abs_diff(b))).sum::<f64>() / 3.0
}

fn colour_weight(difference: f64) -> f64 {
    (1.0 - difference / COLOUR_MAX).max(0.0)
}

/// A known point in a view.
#[derive(Debug, Clone, Copy)]
pub(super) struct Anchor {
    pub view: usize,
    /// Predicted depth there.
    pub other: f64,
    /// Camera z of the point, scene units.
    pub z: f64,
}

/// The samples of each view and the views that each is compared with. Neither depends on scale and shift.
pub(super) struct Pairs<'a> {
    pub views: &'a [MappedView],
    pub samples: Vec<Vec<Sample>>,
    partners: Vec<Vec<usize>>,
}

impl<'a> Pairs<'a> {
    pub fn new(views: &'a [MappedView]) -> Self {
        let samples = views.iter().map(samples).collect();
        let partners = (0..views.len()).map(|index| partners(views, index)).collect();
        Self { views, samples, partners }
    }

    /// All samples that project onto a known depth of another view.
    pub fn matches(&self, fits: &[DepthFit]) -> Vec<Match> {
        let of = |from: usize| {
            let partners = self.partners[from].iter();
            partners.flat_map(move |to| self.samples[from].iter().filter_map(move |s| self.matched(from, *to, s, fits)))
        };
        (0..self.views.len()).into_par_iter().flat_map_iter(of).collect()
    }

    /// How far the photos agree with the depth of one view: the mean colour weight of its samples in other photos, and their number. What
    /// falls on a transparent pixel agrees not at all. The depth of other views takes no part.
    pub fn photo_score(&self, view: usize, fit: DepthFit) -> (f64, usize) {
        let here = &self.views[view];
        let (mut sum, mut count) = (0.0, 0);
        for sample in &self.samples[view] {
            let world = here.world(here.middle(sample.index), fit.apply(sample.depth));
            for there in self.partners[view].iter().map(|partner| &self.views[*partner]) {
                let point = there.camera(world);
                let Some(index) = there.pixel(there.intrinsics.project(point)).filter(|_| point.z > 0.0) else {
                    continue;
                };
                count += 1;
                if !there.transparent[index] {
                    sum += colour_weight(colour_difference(here.color[sample.index], there.color[index]));
                }
            }
        }
        (if count > 0 { sum / count as f64 } else { 0.0 }, count)
    }

    /// The depth relief of what the views see, a share of the depth: nine tenths of the samples of the median view are within it.
    pub fn relief(&self) -> f64 {
        let of = |samples: &Vec<Sample>| {
            let mut depths: Vec<f64> = samples.iter().map(|sample| sample.depth).collect();
            depths.sort_by(f64::total_cmp);
            let at = |share: f64| depths.get((share * depths.len() as f64) as usize).copied();
            Some((at(0.95)? - at(0.05)?) / at(0.5)?)
        };
        median(self.samples.iter().filter_map(of).collect()).unwrap_or(1.0)
    }

    /// The median of the predicted depth of each view's samples; 1 where it has none.
    pub fn usual_depths(&self) -> Vec<f64> {
        let of = |samples: &Vec<Sample>| median(samples.iter().map(|sample| sample.depth).collect()).unwrap_or(1.0);
        self.samples.iter().map(of).collect()
    }

    /// Known points before each view, with the predicted depth where they are seen or hidden.
    pub fn anchors(&self, points: &[DVec3]) -> Vec<Anchor> {
        let step = (points.len() / ANCHORS).max(1);
        let of = |(view, mapped): (usize, &MappedView)| {
            let points = points.iter().step_by(step).map(|point| mapped.camera(*point)).filter(|point| point.z > 0.0);
            let seen = points.filter_map(|point| {
                let position = mapped.intrinsics.project(point);
                let (other, _) = local_depth(mapped, mapped.pixel(position)?, position)?;
                Some(Anchor { view, other, z: point.z })
            });
            seen.collect::<Vec<_>>()
        };
        self.views.iter().enumerate().flat_map(of).collect()
    }

    fn matched(&self, from: usize, to: usize, sample: &Sample, fits: &[DepthFit]) -> Option<Match> {
        let (a, b) = (&self.views[from], &self.views[to]);
        let depth = fits[from].apply(sample.depth);
        let position = a.middle(sample.index);
        let point = b.camera(a.world(position, depth));
        if !(depth > 0.0 && point.z > 0.0) {
            return None;
        }
        let seen = b.intrinsics.project(point);
        let index = b.pixel(seen)?;
        let (other, gradient) = local_depth(b, index, seen)?;
        let fitted = fits[to].apply(other);
        let direction = b.placed.rotation.transpose() * a.placed.rotation * a.intrinsics.ray(position.x, position.y);
        let slope = direction.z - fits[to].scale * gradient.dot(image_motion(b, point, direction));
        Some(Match {
            from,
            to,
            depth: sample.depth,
            other,
            z: point.z,
            slope,
            residual: (point.z - fitted) / point.z,
            colour: colour_difference(a.color[sample.index], b.color[index]),
        })
    }
}

/// The change of the image position of a point that moves along `direction`, camera axes.
fn image_motion(view: &MappedView, point: DVec3, direction: DVec3) -> DVec2 {
    let slope = (direction.truncate() - point.truncate() * (direction.z / point.z)) / point.z;
    DMat2::from_diagonal(DVec2::new(view.intrinsics.fx, view.intrinsics.fy)) * slope
}

/// Predicted depth at a position and its gradient, per pixel; `None` at edges, borders and where depth is unknown.
fn local_depth(view: &MappedView, index: usize, position: DVec2) -> Option<(f64, DVec2)> {
    let (width, height) = view.size;
    let (x, y) = (index % width, index / width);
    if x == 0 || y == 0 || x + 1 >= width || y + 1 >= height {
        return None;
    }
    let middle = view.depth[index];
    let [left, right, above, below] = [index - 1, index + 1, index - width, index + width].map(|i| view.depth[i]);
    let off = [left, right, above, below].iter().map(|z| (z - middle).abs()).fold(0.0, f32::max);
    if !(middle > 0.0 && off <= EDGE * middle) {
        return None;
    }
    let gradient = DVec2::new(f64::from(right - left), f64::from(below - above)) * 0.5;
    Some((f64::from(middle) + gradient.dot(position - view.middle(index)), gradient))
}

/// Evenly spread pixels of a view with a sure depth away from edges.
fn samples(view: &MappedView) -> Vec<Sample> {
    let mut sure: Vec<f32> =
        view.confidence.iter().zip(&view.depth).filter(|(_, z)| **z > 0.0).map(|(c, _)| *c).collect();
    let place = (UNSURE * sure.len() as f64) as usize;
    if sure.is_empty() {
        return Vec::new();
    }
    let least = *sure.select_nth_unstable_by(place, f32::total_cmp).1;
    let usable =
        |index: &usize| view.confidence[*index] >= least && local_depth(view, *index, view.middle(*index)).is_some();
    let all: Vec<usize> = (0..view.depth.len()).filter(usable).collect();
    // A step without a common divisor with most widths, so that samples do not stand in columns.
    let step = (all.len() / SAMPLES).max(1) | 1;
    all.into_iter().step_by(step).map(|index| Sample { index, depth: f64::from(view.depth[index]) }).collect()
}

/// The views nearest to one: the angle between viewing directions in radians plus the distance as a share of the mean distance.
fn partners(views: &[MappedView], index: usize) -> Vec<usize> {
    let here = &views[index].placed;
    let mean = views.iter().map(|view| view.placed.centre.distance(here.centre)).sum::<f64>() / views.len() as f64;
    let far = |other: &usize| {
        let there = &views[*other].placed;
        here.rotation.z_axis.angle_between(there.rotation.z_axis)
            + here.centre.distance(there.centre) / mean.max(f64::MIN_POSITIVE)
    };
    let mut others: Vec<usize> = (0..views.len()).filter(|other| *other != index).collect();
    others.sort_by(|a, b| far(a).total_cmp(&far(b)));
    others.truncate(PARTNERS);
    others
}
