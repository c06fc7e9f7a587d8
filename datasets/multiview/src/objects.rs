//! Centres of several objects that move apart from each other.
//!
//! Regions of different cameras are matched in space: the hull of all masks has connected components, each component
//! is an object, and every region of a mask belongs to the component that projects into it. Where two components
//! share a region (one passes in front of the other) that camera does not count for either.

use glam::DVec3;

use gs_datasets::{Scene, View};

use crate::cameras::instants;
use crate::carve::Voxels;
use crate::centres::{Blob, Centre, centres, locate, mask_of};
use crate::hull::Solid;
use crate::options::{CueOptions, HullOptions, ObjectOptions};
use crate::regions::{self, NOWHERE, regions};

/// Points of the hull. They set its resolution, and components need not be finer.
const POINTS: usize = 3000;

/// One connected component of a hull.
struct Component {
    centre: Centre,
    /// Edge of a cube with its volume, scene units.
    size: f64,
}

/// Centres over time of each object that moves on its own, the object with most centres first. One list with the
/// centre of all moving pixels if objects cannot be told apart. Empty without enough masks; the notes of
/// [`centres`](fn@crate::centres) say why.
pub fn object_centres(scene: &Scene, masks: &[Option<Vec<u8>>], options: &CueOptions) -> Vec<Vec<Centre>> {
    let views = &scene.train;
    let instants = instants(views);
    let (detail, options) = (HullOptions { points: POINTS, ..options.hull }, &options.objects);
    let found = instants.iter().filter_map(|instant| {
        let solid = Solid::of(views, masks, instant, &detail).ok()?;
        Some(components(views, masks, &solid, instant.t, options))
    });
    let mut tracks = linked(found.collect(), options.steady);
    tracks.retain(|track| track.len() as f64 >= options.kept * instants.len() as f64);
    tracks.sort_by_key(|track| std::cmp::Reverse(track.len()));
    if tracks.len() < 2 {
        let all = centres(scene, masks).centres;
        return if all.is_empty() { Vec::new() } else { vec![all] };
    }
    tracks.into_iter().map(|track| track.into_iter().map(|component| component.centre).collect()).collect()
}

/// Links components into tracks, from the time with most components backwards and forwards: two objects that touch
/// are one component, and a track that began there would be wrong.
fn linked(mut found: Vec<Vec<Component>>, steady: usize) -> Vec<Vec<Component>> {
    let most = found.iter().map(Vec::len).max().unwrap_or(0);
    let middle = found.len() / 2;
    let fullest = (0..found.len()).filter(|i| found[*i].len() == most);
    let Some(start) = fullest.min_by_key(|i| i.abs_diff(middle)) else { return Vec::new() };
    let later = found.split_off(start + 1);
    let mut tracks: Vec<Vec<Component>> = Vec::new();
    found.into_iter().rev().for_each(|components| link(&mut tracks, components, steady));
    tracks.iter_mut().for_each(|track| track.reverse());
    later.into_iter().for_each(|components| link(&mut tracks, components, steady));
    tracks.iter_mut().for_each(|track| track.sort_by(|a, b| a.centre.t.total_cmp(&b.centre.t)));
    tracks
}

/// Adds each component to the nearest predicted track, or starts a new one. A component that two established tracks
/// predict is both objects merged and joins neither.
fn link(tracks: &mut Vec<Vec<Component>>, components: Vec<Component>, steady: usize) {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (i, track) in tracks.iter().enumerate() {
        for (j, component) in components.iter().enumerate() {
            let distance = expected(track, component.centre.t).distance(component.centre.position);
            // A track continues when the component is off the prediction by at most its own size.
            if distance <= track.last().map_or(0.0, |last| last.size.max(component.size)) {
                pairs.push((distance, i, j));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut takers: Vec<Option<usize>> = vec![None; components.len()];
    let mut taken = vec![false; tracks.len()];
    for (_, i, j) in &pairs {
        if !taken[*i] && takers[*j].is_none() {
            (taken[*i], takers[*j]) = (true, Some(*i));
        }
    }
    let is_both = |j: usize| pairs.iter().any(|(_, i, at)| *at == j && !taken[*i] && tracks[*i].len() >= steady);
    let both: Vec<bool> = (0..components.len()).map(is_both).collect();
    for (j, component) in components.into_iter().enumerate() {
        match takers[j] {
            Some(_) if both[j] => {}
            Some(i) => tracks[i].push(component),
            None => tracks.push(vec![component]),
        }
    }
}

/// Linear prediction of a track at a time.
fn expected(track: &[Component], t: f64) -> DVec3 {
    match track {
        [] => DVec3::NAN,
        [only] => only.centre.position,
        [.., a, b] => {
            let (a, b) = (&a.centre, &b.centre);
            b.position + (b.position - a.position) * ((t - b.t) / (b.t - a.t))
        }
    }
}

/// Components of one time with their centres.
fn components(
    views: &[View],
    masks: &[Option<Vec<u8>>],
    solid: &Solid,
    t: f64,
    options: &ObjectOptions,
) -> Vec<Component> {
    let voxels = &solid.voxels;
    let (labels, counts) = label(voxels);
    let largest = counts.iter().copied().max().unwrap_or(0) as f64;
    let real: Vec<usize> = (0..counts.len()).filter(|i| counts[*i] as f64 >= options.phantom * largest).collect();
    let mut blobs: Vec<Vec<(Blob, &View)>> = counts.iter().map(|_| Vec::new()).collect();
    for (silhouette, index) in solid.silhouettes.iter().zip(&solid.views) {
        let Some(mask) = mask_of(views, masks, *index) else { continue };
        let view = &views[*index];
        let size = (view.width, view.height);
        let found = regions(size, true, |pixel| mask[pixel] != 0);
        // For each region and component, the number of voxels that project there.
        let mut hits = vec![vec![0_usize; counts.len()]; found.list.len()];
        for cell in voxels.cells() {
            let component = labels[voxels.index(cell)] as usize;
            let seen = silhouette.camera.sees(voxels.position(cell));
            let region = seen.map_or(NOWHERE, |(pixel, _)| found.labels[pixel]);
            if region != NOWHERE {
                hits[region as usize][component] += 1;
            }
        }
        for component in &real {
            let own: Vec<bool> = hits
                .iter()
                .map(|row| {
                    row[*component] > 0 && row[*component] as f64 >= options.owned * row.iter().sum::<usize>() as f64
                })
                .collect();
            let shown: usize = hits.iter().zip(&own).filter(|(_, own)| **own).map(|(row, _)| row[*component]).sum();
            if (shown as f64) < options.shown * counts[*component] as f64 {
                continue;
            }
            let pixels =
                (0..mask.len()).filter(|pixel| found.labels[*pixel] != NOWHERE && own[found.labels[*pixel] as usize]);
            if let Some(blob) = Blob::of_pixels(pixels, size.0, size.1) {
                blobs[*component].push((blob, view));
            }
        }
    }
    let middles = middles(voxels, &labels, counts.len());
    real.iter()
        .map(|component| {
            let size = voxels.edge * (counts[*component] as f64).cbrt();
            let centre = match locate(&blobs[*component]) {
                Ok((position, residual_px, cameras)) => Centre { t, position, residual_px, cameras },
                // Too few cameras see it alone: the centroid of the component, accurate to about a voxel.
                Err(_) => {
                    let position = middles[*component];
                    let voxel = solid.silhouettes.iter().filter_map(|one| {
                        one.camera.project(position).map(|(_, depth)| voxels.edge * one.camera.focal() / depth)
                    });
                    Centre { t, position, residual_px: voxel.fold(0.0, f64::max), cameras: solid.silhouettes.len() }
                }
            };
            Component { centre, size }
        })
        .collect()
}

/// Index of each voxel's component, [`NOWHERE`] if empty, and the number of voxels of each component.
fn label(voxels: &Voxels) -> (Vec<u32>, Vec<usize>) {
    let mut counts = Vec::new();
    let around = |index: usize, visit: &mut dyn FnMut(usize)| {
        voxels.around(voxels.cell(index), true).for_each(|next| visit(voxels.index(next)));
    };
    let labels = regions::label(
        voxels.filled.len(),
        |index| voxels.filled[index],
        around,
        |component, _| {
            if component == counts.len() {
                counts.push(0);
            }
            counts[component] += 1;
        },
    );
    (labels, counts)
}

fn middles(voxels: &Voxels, labels: &[u32], components: usize) -> Vec<DVec3> {
    let mut sums = vec![(DVec3::ZERO, 0.0); components];
    for cell in voxels.cells() {
        let sum = &mut sums[labels[voxels.index(cell)] as usize];
        sum.0 += voxels.position(cell);
        sum.1 += 1.0;
    }
    sums.into_iter().map(|(sum, count)| sum / count).collect()
}
