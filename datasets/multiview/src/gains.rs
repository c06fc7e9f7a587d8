//! How bright photos are against each other, from points that several of them show.
//!
//! A longer exposure and another white balance multiply light, and the encoding of a file is close to a power, so the
//! encoded colour of a surface is multiplied too:
//!
//! ```text
//! ln c(photo, point) = l(point) + g(source of the photo) + rest
//! ```
//!
//! in each channel. The rest has heavy tails, because a point may be hidden in a photo, so `l` and `g` are medians of
//! what the other one leaves, in turn. A source is a photo or a camera.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec2, DVec3, Vec3};
use gs_base::statistics::median_by;
use gs_datasets::View;
use rayon::prelude::*;

use crate::grey::Grey;
use crate::patch::{Patch, TEXTURE};
use crate::pixels::counts;

/// Points looked at, evenly spaced among those given.
const POINTS: usize = 4000;

/// Colours are means over squares of this share of a photo's width, so that poses a pixel off change them little.
const SQUARE: f64 = 1.0 / 160.0;

/// Darker and brighter levels are noise, or clipped.
const LEVELS: [f64; 2] = [12.0, 243.0];

/// Width of the reduced photos whose patches are compared, pixels.
const WIDTH: usize = 320;

/// Smallest correlation of patches that show one surface.
const AGREES: f64 = 0.85;

/// Most rounds of medians, and the change of all gains below which they end: along a ring of photos, each of which
/// shares points with its neighbours alone, differences add up slowly.
const ROUNDS: (usize, f64) = (100, 1e-4);

/// Fewest sources that show a point which counts, and fewest points of a source whose gain is known.
const FEWEST: (usize, usize) = (2, 20);

/// Most photos of a source that are looked at, evenly spaced: those of a camera repeat each other.
const PHOTOS: usize = 3;

/// The gains of photos' sources.
#[derive(Debug, Clone, PartialEq)]
pub struct Gains {
    /// `[sources]` natural logarithms of each channel's gain; their mean over the photos is zero.
    pub logarithms: Vec<[f64; 3]>,
    /// Median size of what the gains leave at points that did not determine them, over that without gains.
    pub left: f64,
}

impl Gains {
    /// Root of the mean square over sources and channels.
    pub fn spread(&self) -> f64 {
        let squares = self.logarithms.iter().flatten().map(|gain| gain * gain);
        (squares.sum::<f64>() / (3 * self.logarithms.len()).max(1) as f64).sqrt()
    }
}

/// The gains of the sources of photos of one scene. `sources` names one for each view, from 0 on without a gap.
/// `None` where the points tell too little.
///
/// # Panics
/// If `sources` has another length than `views`.
pub fn gains(views: &[View], sources: &[usize], points: &[[f32; 3]]) -> Option<Gains> {
    assert_eq!(views.len(), sources.len(), "a source for each view");
    let count = sources.iter().max()? + 1;
    let seen = observe(views, sources, points);
    let half = |odd: usize| seen.iter().skip(odd).step_by(2).collect::<Vec<_>>();
    let known = solve(&half(0), count)?;
    let other = half(1);
    let (without, with) = (left(&other, &vec![[0.0; 3]; count])?, left(&other, &known)?);
    let mut logarithms = solve(&seen.iter().collect::<Vec<_>>(), count)?;
    centre(&mut logarithms, sources);
    Some(Gains { logarithms, left: if without > 0.0 { with / without } else { 1.0 } })
}

/// A point's colours: source, and natural logarithms of the channels.
type Seen = Vec<(usize, [f64; 3])>;

/// The colours of some points, each in the photos whose patches around it agree, so that it is not hidden there.
fn observe(views: &[View], sources: &[usize], points: &[[f32; 3]]) -> Vec<Seen> {
    let looked_at: Vec<usize> = looked_at(sources);
    let photos: Vec<Grey> = looked_at.par_iter().map(|view| Grey::of(&views[*view], WIDTH)).collect();
    let step = points.len().div_ceil(POINTS).max(1);
    let chosen: Vec<DVec3> = points.iter().step_by(step).map(|point| Vec3::from(*point).as_dvec3()).collect();
    let of = |(index, point): (usize, &DVec3)| -> Seen {
        let patches: Vec<(usize, DVec2, Patch)> = photos
            .iter()
            .enumerate()
            .filter_map(|(photo, grey)| patch_of(grey, *point).map(|(at, patch)| (photo, at, patch)))
            .collect();
        if patches.is_empty() {
            return Seen::new();
        }
        let reference = &patches[index.wrapping_mul(7919) % patches.len()].2;
        let agrees = |(photo, at, patch): &(usize, DVec2, Patch)| {
            let view = looked_at[*photo];
            let color = || logarithms(&views[view], (*at * photos[*photo].step as f64).to_array());
            (patch.correlation(reference) >= AGREES).then(color).flatten().map(|color| (sources[view], color))
        };
        patches.iter().filter_map(agrees).collect()
    };
    let counts = |seen: &Seen| seen.iter().map(|(source, _)| source).collect::<BTreeSet<_>>().len() >= FEWEST.0;
    chosen.par_iter().enumerate().map(of).filter(counts).collect()
}

/// Some views of each source.
fn looked_at(sources: &[usize]) -> Vec<usize> {
    let mut of: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    sources.iter().enumerate().for_each(|(view, source)| of.entry(*source).or_default().push(view));
    let spread = |views: Vec<usize>| {
        let count = views.len().min(PHOTOS);
        (0..count).map(|i| views[(2 * i + 1) * views.len() / (2 * count)]).collect::<Vec<_>>()
    };
    of.into_values().flat_map(spread).collect()
}

/// Where a photo shows a point, reduced pixels, and the patch there; `None` outside, and where it has no texture.
fn patch_of(photo: &Grey, point: DVec3) -> Option<(DVec2, Patch)> {
    let seen = photo.viewmat.transform_point3(point);
    let at = (seen.z > 0.0).then(|| photo.intrinsics.project(seen))?;
    let patch = Patch::around(&photo.pixels, at, 1.0)?;
    (patch.deviation() >= TEXTURE).then_some((at, patch))
}

/// The mean colour of a square around a position, as natural logarithms; `None` outside the photo, where pixels do not
/// count, and where a channel is clipped.
fn logarithms(view: &View, at: [f64; 2]) -> Option<[f64; 3]> {
    let half = 0.5 * (SQUARE * view.width as f64).max(1.0);
    let span = |at: f64, size: usize| {
        let (first, end) = ((at - half).round(), (at + half).round());
        (first >= 0.0 && end <= size as f64 && end > first).then_some(first as usize..end as usize)
    };
    let (columns, rows) = (span(at[0], view.width)?, span(at[1], view.height)?);
    let pixels = columns.len() * rows.len();
    let mut sums = [0_u32; 3];
    for row in rows {
        for pixel in columns.clone().map(|column| row * view.width + column) {
            let opaque = view.alpha.as_ref().is_none_or(|alpha| alpha[pixel] == 255);
            if !(opaque && counts(view, pixel)) {
                return None;
            }
            (0..3).for_each(|c| sums[c] += u32::from(view.image.data[3 * pixel + c]));
        }
    }
    let means = sums.map(|sum| f64::from(sum) / pixels as f64);
    means.iter().all(|mean| (LEVELS[0]..=LEVELS[1]).contains(mean)).then(|| means.map(|mean| (mean / 255.0).ln()))
}

/// The gains by medians in turn; `None` if a source shows too few points.
fn solve(seen: &[&Seen], count: usize) -> Option<Vec<[f64; 3]>> {
    let mut gains = vec![[0.0; 3]; count];
    let mut of_source: Vec<[Vec<f64>; 3]> = vec![Default::default(); count];
    for _ in 0..ROUNDS.0 {
        let mut change: f64 = 0.0;
        of_source.iter_mut().flatten().for_each(Vec::clear);
        for point in seen {
            let level = level(point, &gains);
            for (source, color) in point.iter() {
                (0..3).for_each(|c| of_source[*source][c].push(color[c] - level[c]));
            }
        }
        for (gain, rests) in gains.iter_mut().zip(&mut of_source) {
            if rests[0].len() < FEWEST.1 {
                return None;
            }
            for (gain, rests) in gain.iter_mut().zip(rests) {
                let found = median_by(rests, f64::total_cmp)?;
                change = change.max((found - *gain).abs());
                *gain = found;
            }
        }
        if change < ROUNDS.1 {
            break;
        }
    }
    Some(gains)
}

/// The median over its photos of a point's colour without their gains.
fn level(point: &Seen, gains: &[[f64; 3]]) -> [f64; 3] {
    std::array::from_fn(|c| {
        let mut values: Vec<f64> = point.iter().map(|(source, color)| color[c] - gains[*source][c]).collect();
        median_by(&mut values, f64::total_cmp).unwrap_or_default()
    })
}

/// Median size of the rest with these gains.
fn left(seen: &[&Seen], gains: &[[f64; 3]]) -> Option<f64> {
    let rests = seen.iter().flat_map(|point| {
        let level = level(point, gains);
        point.iter().flat_map(move |(source, color)| {
            (0..3).map(|c| (color[c] - gains[*source][c] - level[c]).abs()).collect::<Vec<_>>()
        })
    });
    median_by(&mut rests.collect::<Vec<f64>>(), f64::total_cmp)
}

/// Subtracts the mean over the photos.
fn centre(gains: &mut [[f64; 3]], sources: &[usize]) {
    let mean: [f64; 3] =
        std::array::from_fn(|c| sources.iter().map(|source| gains[*source][c]).sum::<f64>() / sources.len() as f64);
    gains.iter_mut().for_each(|gain| (0..3).for_each(|c| gain[c] -= mean[c]));
}
