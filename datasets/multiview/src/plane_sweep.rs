//! Points by a sparse plane sweep, for data sets without points or with few.
//!
//! A random pixel of a random photo is searched in a few neighbouring photos at depths along its ray. The best depth
//! is where the patches correlate best (zero-mean normalised cross-correlation, which brightness does not change). It
//! counts if the correlation is high and clearly higher than at any other depth, so surfaces without texture, hidden
//! from the others or repetitive give no point. [`plane_sweep`] tries one range of depths, and its positions are accurate to one step
//! of depth: a start for training, not a reconstruction. [`plane_sweep_around`] tries the depths that known points span around the
//! pixel, some ten instead of 96, and takes the top of the parabola through the best depth and its neighbours.

use glam::{DVec2, Vec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use gs_datasets::{Intrinsics, PointCloud, View};

use crate::depth_range::DepthRange;
use crate::patch::{Compared, Patch, Pixels, RowPatch};

/// Photos are reduced to about this width, so that patches span enough of the scene to be distinctive.
const WIDTH: usize = 320;

/// Most depths tried along a ray, evenly in their logarithm: over a factor of ten a step is 2.4 %.
const DEPTHS: usize = 96;

/// Ratio of two neighbouring depths where known points give the range; at the preferred baseline the patch moves by two pixels.
const STEP: f64 = 1.0245;

/// Photos searched, and how many of them must agree. The best ones count: in the others something may be in between.
const OTHERS: (usize, usize) = (5, 3);

/// Preferred baseline of two cameras, in distances to the subject: shorter ones do not resolve depth, longer ones
/// show another side. The photos nearest to it (by ratio) are searched.
const BASELINE: f64 = 0.25;

/// Largest angle between two cameras' axes, as a cosine.
const FACING: f64 = 0.6;

/// Smallest mean correlation of a point's patches, and its smallest lead over any other depth (more than [`APART`]
/// steps away).
const CORRELATION: (f64, f64) = (0.8, 0.1);

/// Steps within which correlations belong to one peak.
const APART: usize = 4;

/// Smallest standard deviation of a patch, 0 to 1. Below it the correlation is of noise.
const TEXTURE: f64 = 0.02;

/// Rays tried for each point asked for.
const TRIES: usize = 6;

/// A reduced grey photo.
struct Grey {
    pixels: Pixels,
    intrinsics: Intrinsics,
    viewmat: glam::DMat4,
    /// Original pixels along a side of a reduced one.
    step: usize,
}

/// Up to `count` points at depths from `near` to `far` (scene units, positive) on which photos of a static scene
/// agree, in the colours of their pixels. The result depends on the seed alone, not on the number of threads.
pub fn plane_sweep(views: &[View], near: f64, far: f64, count: usize, seed: u64) -> PointCloud {
    let usable = near > 0.0 && far > near && far.is_finite();
    if views.len() < 3 || !usable || count == 0 {
        return PointCloud::default();
    }
    let photos: Vec<Grey> = views.par_iter().map(Grey::of).collect();
    let depths = Depths::between(near, far, DEPTHS);
    sweep(views, &photos, (near * far).sqrt(), count, seed, |_, _| Some((depths.clone(), Peak::Best)))
}

/// Up to `count` points on which photos of a static scene agree, near the depths that `known` points of the scene span around each pixel.
/// `distance` is that of the subject, scene units. The result depends on the seed alone, not on the number of threads.
pub fn plane_sweep_around(views: &[View], known: &[[f32; 3]], distance: f64, count: usize, seed: u64) -> PointCloud {
    let usable = distance > 0.0 && distance.is_finite();
    if views.len() < 3 || !usable || count == 0 || known.is_empty() {
        return PointCloud::default();
    }
    let photos: Vec<Grey> = views.par_iter().map(Grey::of).collect();
    let of = |photo: &Grey| {
        DepthRange::of(known, &photo.viewmat, &photo.intrinsics, photo.pixels.width, photo.pixels.height)
    };
    let ranges: Vec<DepthRange> = photos.par_iter().map(of).collect();
    let depths = |from: usize, pixel| {
        let [near, far] = ranges[from].at(pixel)?;
        let steps = ((far / near).ln() / STEP.ln()).ceil() as usize + 1;
        Some((Depths::between(near, far, steps.min(DEPTHS)), Peak::Parabola))
    };
    sweep(views, &photos, distance, count, seed, depths)
}

/// Depths tried along a ray.
#[derive(Clone)]
struct Depths(Vec<f64>);

impl Depths {
    /// `count` depths, evenly in their logarithm.
    fn between(near: f64, far: f64, count: usize) -> Self {
        Self((0..count).map(|i| near * (far / near).powf(i as f64 / (count - 1) as f64)).collect())
    }

    /// The depth at a position between two of them.
    fn at(&self, index: f64) -> f64 {
        let whole = (index as usize).min(self.0.len() - 2);
        self.0[whole] * (self.0[whole + 1] / self.0[whole]).powf(index - whole as f64)
    }
}

/// The depth that is taken where correlation is highest.
#[derive(Clone, Copy, PartialEq)]
enum Peak {
    /// The best of those tried.
    Best,
    /// The top of the parabola through it and its two neighbours.
    Parabola,
}

/// Points on random rays of random photos, at the depths that `depths` gives for a photo's index and a pixel.
fn sweep(
    views: &[View],
    photos: &[Grey],
    distance: f64,
    count: usize,
    seed: u64,
    depths: impl Fn(usize, [usize; 2]) -> Option<(Depths, Peak)> + Sync,
) -> PointCloud {
    let mut points = PointCloud::default();
    let beside = neighbours(views, distance);
    let find = |ray: usize| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(ray as u64);
        let from = rng.random_range(0..views.len());
        let Pixels { width, height, .. } = photos[from].pixels;
        let pixel = [rng.random_range(0..width), rng.random_range(0..height)];
        let view = &views[from];
        let at = pixel.map(|x| x * photos[from].step + photos[from].step / 2);
        let (column, row) = (at[0].min(view.width - 1), at[1].min(view.height - 1));
        if view.mask.as_ref().is_some_and(|mask| mask[row * view.width + column] == 0) {
            return None;
        }
        let (depths, peak) = depths(from, pixel)?;
        let search = Search { photos, from, beside: &beside[from], pixel, depths: &depths };
        let depth = match peak {
            Peak::Best => search.depth::<Patch>(peak),
            Peak::Parabola => search.depth::<RowPatch>(peak),
        }?;
        let position =
            view.c2w.transform_point3(view.intrinsics.ray(column as f64 + 0.5, row as f64 + 0.5) * depth).as_vec3();
        let color = [0, 1, 2].map(|c| view.image.data[3 * (row * view.width + column) + c]);
        Some((position, color))
    };
    for batch in 0..TRIES {
        let rays = batch * count..(batch + 1) * count;
        let found: Vec<(Vec3, [u8; 3])> = rays.into_par_iter().filter_map(find).collect();
        for (position, color) in found.into_iter().take(count - points.len()) {
            points.positions.push(position.to_array());
            points.colors.push(color);
        }
        if points.len() == count {
            break;
        }
    }
    points
}

impl Grey {
    /// The mean of the channels over blocks of pixels.
    fn of(view: &View) -> Self {
        let step = view.width.div_ceil(WIDTH).max(1);
        let (width, height) = ((view.width / step).max(1), (view.height / step).max(1));
        let mut values = vec![0.0; width * height];
        for (index, value) in values.iter_mut().enumerate() {
            let (x, y) = (index % width * step, index / width * step);
            let (last_x, last_y) = ((x + step).min(view.width), (y + step).min(view.height));
            let block = (y..last_y).flat_map(|row| (x..last_x).map(move |column| 3 * (row * view.width + column)));
            let sum: u32 = block.flat_map(|i| &view.image.data[i..i + 3]).map(|c| u32::from(*c)).sum();
            *value = sum as f32 / (255 * 3 * (last_x - x) * (last_y - y)) as f32;
        }
        let scale = 1.0 / step as f64;
        Self {
            pixels: Pixels { width, height, values },
            intrinsics: view.intrinsics.scaled(scale, scale),
            viewmat: view.c2w.inverse(),
            step,
        }
    }
}

/// For each view the views to search: similar direction, preferred baseline.
fn neighbours(views: &[View], subject: f64) -> Vec<Vec<usize>> {
    let of = |view: &View| {
        let fitness = |other: &View| {
            let baseline = other.c2w.w_axis.distance(view.c2w.w_axis) / subject;
            let faces = other.c2w.z_axis.dot(view.c2w.z_axis) >= FACING;
            (faces && baseline > 1e-3).then(|| (baseline / BASELINE).ln().abs())
        };
        let mut others: Vec<(f64, usize)> =
            views.iter().enumerate().filter_map(|(i, other)| Some((fitness(other)?, i))).collect();
        others.sort_by(|a, b| a.0.total_cmp(&b.0));
        others.truncate(OTHERS.0);
        others.into_iter().map(|(_, i)| i).collect()
    };
    views.iter().map(of).collect()
}

/// The search for a pixel's depth.
struct Search<'a> {
    photos: &'a [Grey],
    /// The pixel's photo.
    from: usize,
    /// Photos in which its patch is looked for.
    beside: &'a [usize],
    pixel: [usize; 2],
    depths: &'a Depths,
}

impl Search<'_> {
    /// Depth at which the pixel's patch is found again; `None` if ambiguous.
    fn depth<P: Compared>(&self, peak: Peak) -> Option<f64> {
        let Self { photos, from, beside, pixel, depths } = self;
        let photo = &photos[*from];
        let position = DVec2::new(pixel[0] as f64 + 0.5, pixel[1] as f64 + 0.5);
        let patch = P::around(&photo.pixels, position, 1.0).filter(|patch| patch.deviation() >= TEXTURE)?;
        let ray = photo.intrinsics.ray(position.x, position.y);
        let to_world = photo.viewmat.inverse();
        let scores: Vec<f64> = depths
            .0
            .iter()
            .map(|depth| {
                let world = to_world.transform_point3(ray * *depth);
                let found = |other: &usize| {
                    let other = &photos[*other];
                    let seen = other.viewmat.transform_point3(world);
                    if seen.z <= 0.0 {
                        return None;
                    }
                    let k = &other.intrinsics;
                    let at = k.project(seen);
                    // Size of a pixel at that depth in the other camera.
                    let spacing = (k.fx / seen.z) / (photo.intrinsics.fx / depth);
                    Some(patch.correlation(&P::around(&other.pixels, at, spacing)?))
                };
                let mut agreed: Vec<f64> = beside.iter().filter_map(found).collect();
                agreed.sort_by(|a, b| b.total_cmp(a));
                if agreed.len() < OTHERS.1 { -1.0 } else { agreed[..OTHERS.1].iter().sum::<f64>() / OTHERS.1 as f64 }
            })
            .collect();
        let count = scores.len();
        let best = (0..count).max_by(|a, b| scores[*a].total_cmp(&scores[*b]))?;
        let elsewhere = (0..count).filter(|i| i.abs_diff(best) > APART).map(|i| scores[i]).fold(-1.0, f64::max);
        // At either end the true depth may lie beyond.
        let inside = best > 0 && best + 1 < count;
        let is_clear = inside && scores[best] >= CORRELATION.0 && scores[best] - elsewhere >= CORRELATION.1;
        is_clear.then(|| match peak {
            Peak::Best => depths.0[best],
            Peak::Parabola => depths.at(best as f64 + top(scores[best - 1], scores[best], scores[best + 1])),
        })
    }
}

/// Where a parabola through three values at -1, 0 and 1 is highest, from -0.5 to 0.5, if the middle one is the largest. A neighbour without
/// a correlation (-1) says nothing of the shape.
fn top(before: f64, best: f64, after: f64) -> f64 {
    let bend = before - 2.0 * best + after;
    if before.min(after) <= 0.0 || bend >= 0.0 { 0.0 } else { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_top_of_a_parabola() {
        let at = |x: f64| 0.9 - (x - 0.3).powi(2) * 0.2;
        assert!((top(at(-1.0), at(0.0), at(1.0)) - 0.3).abs() < 1e-12);
        assert_eq!(top(-1.0, 0.9, 0.8), 0.0, "a neighbour without a correlation");
        assert_eq!(top(0.9, 0.9, 0.9), 0.0);
    }

    #[test]
    fn depths_between_two_steps_are_even_in_their_logarithm() {
        let depths = Depths::between(1.0, 16.0, 5);
        assert!((depths.at(2.5) - 32.0f64.sqrt()).abs() < 1e-12);
        assert!((depths.at(4.0) - 16.0).abs() < 1e-12);
    }
}
