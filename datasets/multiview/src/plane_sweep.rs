//! Points by a sparse plane sweep, for data sets without points or with few.
//!
//! A random pixel of a random photo is searched in a few neighbouring photos at depths along its ray. The best depth is
//! where the patches correlate best (zero-mean normalised cross-correlation, which brightness does not change). It
//! counts if the correlation is high and clearly higher than at any other depth, so surfaces without texture, hidden
//! from the others or repetitive give no point. The depth is the top of the parabola through the best one tried and its
//! neighbours. [`plane_sweep`] tries one range of depths, [`plane_sweep_around`] those that known points span around
//! the pixel: some twenty instead of 96, so that it can afford wider photos.

use glam::{DVec2, Vec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use gs_datasets::{PointCloud, View};

use crate::depth_range::DepthRange;
use crate::grey::Grey;
use crate::patch::{Patch, Pixels, TEXTURE};
use crate::pixels::{color, counts};

/// Photos are reduced to about this width where nothing is known of their depths, so that patches span enough of the
/// scene to be distinctive over many depths.
const WIDTH: usize = 320;

/// The width where known points give the range. Patches span half as much, so that points are found where texture is
/// fine, which is where Gaussians are needed: 0.05 to 0.4 dB more than the other width after 700 steps, on four sets.
const FINE_WIDTH: usize = 640;

/// Most depths tried along a ray, evenly in their logarithm: over a factor of ten a step is 2.4 %.
const DEPTHS: usize = 96;

/// Ratio of two neighbouring depths where known points give the range; at the preferred baseline the patch moves by two
/// pixels.
const STEP: f64 = 1.0122;

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

/// Rays tried for each point asked for.
const TRIES: usize = 6;

/// Up to `count` points at depths from `near` to `far` (scene units, positive) on which photos of a static scene
/// agree, in the colours of their pixels. The result depends on the seed alone, not on the number of threads.
pub fn plane_sweep(views: &[View], near: f64, far: f64, count: usize, seed: u64) -> PointCloud {
    let usable = near > 0.0 && far > near && far.is_finite();
    if views.len() < 3 || !usable || count == 0 {
        return PointCloud::default();
    }
    let depths = Depths::between(near, far, DEPTHS);
    sweep(views, &Grey::all(views, WIDTH), (near * far).sqrt(), count, seed, |_, _| Some(depths.clone()))
}

/// Up to `count` points on which photos of a static scene agree, near the depths that `known` points of the scene span
/// around each pixel. `distance` is that of the subject, scene units. The result depends on the seed alone, not on the
/// number of threads.
pub fn plane_sweep_around(views: &[View], known: &[[f32; 3]], distance: f64, count: usize, seed: u64) -> PointCloud {
    let usable = distance > 0.0 && distance.is_finite();
    if views.len() < 3 || !usable || count == 0 || known.is_empty() {
        return PointCloud::default();
    }
    let photos = Grey::all(views, FINE_WIDTH);
    let of = |photo: &Grey| {
        DepthRange::of(known, &photo.viewmat, &photo.intrinsics, photo.pixels.width, photo.pixels.height)
    };
    let ranges: Vec<DepthRange> = photos.par_iter().map(of).collect();
    let depths = |from: usize, pixel| {
        let [near, far] = ranges[from].at(pixel)?;
        let steps = ((far / near).ln() / STEP.ln()).ceil() as usize + 1;
        Some(Depths::between(near, far, steps.min(DEPTHS)))
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

/// Points on random rays of random photos, at the depths that `depths` gives for a photo's index and a pixel.
fn sweep(
    views: &[View],
    photos: &[Grey],
    distance: f64,
    count: usize,
    seed: u64,
    depths: impl Fn(usize, [usize; 2]) -> Option<Depths> + Sync,
) -> PointCloud {
    let mut points = PointCloud::default();
    let beside = neighbours(views, distance);
    let find = |ray: usize| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(ray as u64);
        let from = rng.random_range(0..views.len());
        let Grey { pixels: Pixels { width, height, .. }, step, .. } = photos[from];
        let pixel = [rng.random_range(0..width), rng.random_range(0..height)];
        let view = &views[from];
        let [column, row] = pixel.map(|x| x * step + step / 2);
        let (column, row) = (column.min(view.width - 1), row.min(view.height - 1));
        if !counts(view, row * view.width + column) {
            return None;
        }
        let depths = depths(from, pixel)?;
        let centre = DVec2::from(pixel.map(|x| x as f64 + 0.5));
        let depth = depths.at(Search { photos, from, beside: &beside[from] }.peak(centre, &depths)?);
        let ray = photos[from].intrinsics.ray(centre.x, centre.y);
        let position = view.c2w.transform_point3(ray * depth).as_vec3();
        Some((position, color(view, row * view.width + column)))
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

/// The search for the depth of a photo's pixels.
struct Search<'a> {
    photos: &'a [Grey],
    /// The pixels' photo.
    from: usize,
    /// Photos in which their patches are looked for.
    beside: &'a [usize],
}

impl Search<'_> {
    /// Where among `depths` the patch around a position, in pixels, is found again, as an index between two of them;
    /// `None` if that is ambiguous.
    fn peak(&self, position: DVec2, depths: &Depths) -> Option<f64> {
        let photo = &self.photos[self.from];
        let patch = Patch::around(&photo.pixels, position, 1.0).filter(|patch| patch.deviation() >= TEXTURE)?;
        let ray = photo.intrinsics.ray(position.x, position.y);
        let to_world = photo.viewmat.inverse();
        let agreement = |depth: &f64| {
            let world = to_world.transform_point3(ray * *depth);
            let found = |other: &usize| {
                let other = &self.photos[*other];
                let seen = other.viewmat.transform_point3(world);
                if seen.z <= 0.0 {
                    return None;
                }
                let k = &other.intrinsics;
                let at = k.project(seen);
                // Size of a pixel at that depth in the other camera.
                let spacing = (k.fx / seen.z) / (photo.intrinsics.fx / depth);
                Some(patch.correlation(&Patch::around(&other.pixels, at, spacing)?))
            };
            let mut agreed: Vec<f64> = self.beside.iter().filter_map(found).collect();
            agreed.sort_by(|a, b| b.total_cmp(a));
            if agreed.len() < OTHERS.1 { -1.0 } else { agreed[..OTHERS.1].iter().sum::<f64>() / OTHERS.1 as f64 }
        };
        let scores: Vec<f64> = depths.0.iter().map(agreement).collect();
        let count = scores.len();
        let best = (0..count).max_by(|a, b| scores[*a].total_cmp(&scores[*b]))?;
        let elsewhere = (0..count).filter(|i| i.abs_diff(best) > APART).map(|i| scores[i]).fold(-1.0, f64::max);
        // At either end the true depth may lie beyond.
        let inside = best > 0 && best + 1 < count;
        let is_clear = inside && scores[best] >= CORRELATION.0 && scores[best] - elsewhere >= CORRELATION.1;
        is_clear.then(|| best as f64 + top(scores[best - 1], scores[best], scores[best + 1]))
    }
}

/// Where a parabola through three values at -1, 0 and 1 is highest, from -0.5 to 0.5, if the middle one is the largest.
/// A neighbour without a correlation (-1) says nothing of the shape.
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
