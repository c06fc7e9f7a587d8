//! Centres of several objects that move apart from each other.
//!
//! Which spot of one camera is which of another is decided in space: the hull of all masks falls into pieces, each
//! piece is an object, and every region of a mask belongs to the piece that projects into it. Where two pieces share a
//! region (one passes in front of the other) that camera says nothing about either.

use glam::{DVec3, UVec3};

use gs_datasets::{Scene, View};

use crate::cameras::instants;
use crate::carve::Voxels;
use crate::guide::{Centre, Spot, centres, locate, mask_of};
use crate::hull::{HullOptions, Solid};
use crate::regions::{NOWHERE, regions};

/// Points asked of the hull: they choose its resolution, and pieces need not be finer than this.
const DETAIL: HullOptions = HullOptions { points: 3000, misses: None };

/// A piece smaller than this share of the largest is none: where several objects' cones cross, hulls have phantoms.
const PHANTOM: f64 = 0.05;

/// A region belongs to a piece when this share of the voxels that project into it are of the piece.
const OWNED: f64 = 0.95;

/// A camera speaks for a piece when this share of the piece projects into regions of its own.
const SHOWN: f64 = 0.9;

/// A track is kept when it has a centre at this share of the times.
const KEPT: f64 = 0.5;

/// Times after which a track is no chance piece any more, and may contest another's.
const STEADY: usize = 3;

/// One piece of a hull.
struct Piece {
    centre: Centre,
    /// Edge of a cube with its volume, scene units.
    size: f64,
}

/// Centres over time of each object that moves apart from the others, the one with most centres first; one list with
/// the centre of everything where they cannot be told apart. Empty without enough masks; [`centres`] says why.
pub fn object_centres(scene: &Scene, masks: &[Option<Vec<u8>>]) -> Vec<Vec<Centre>> {
    let views = &scene.train;
    let instants = instants(views);
    let found = instants.iter().filter_map(|instant| {
        let solid = Solid::of(views, masks, instant, &DETAIL).ok()?;
        Some(pieces(views, masks, &solid, instant.t))
    });
    let mut tracks = linked(found.collect());
    tracks.retain(|track| track.len() as f64 >= KEPT * instants.len() as f64);
    tracks.sort_by_key(|track| std::cmp::Reverse(track.len()));
    if tracks.len() < 2 {
        let all = centres(scene, masks).centres;
        return if all.is_empty() { Vec::new() } else { vec![all] };
    }
    tracks.into_iter().map(|track| track.into_iter().map(|piece| piece.centre).collect()).collect()
}

/// The tracks through the pieces of all times, from the time with most pieces back and on: where two objects touch they are one
/// piece, which would lead a track that began with it astray.
fn linked(mut found: Vec<Vec<Piece>>) -> Vec<Vec<Piece>> {
    let most = found.iter().map(Vec::len).max().unwrap_or(0);
    let middle = found.len() / 2;
    let fullest = (0..found.len()).filter(|i| found[*i].len() == most);
    let Some(start) = fullest.min_by_key(|i| i.abs_diff(middle)) else { return Vec::new() };
    let later = found.split_off(start + 1);
    let mut tracks: Vec<Vec<Piece>> = Vec::new();
    found.into_iter().rev().for_each(|pieces| link(&mut tracks, pieces));
    tracks.iter_mut().for_each(|track| track.reverse());
    later.into_iter().for_each(|pieces| link(&mut tracks, pieces));
    tracks.iter_mut().for_each(|track| track.sort_by(|a, b| a.centre.t.total_cmp(&b.centre.t)));
    tracks
}

/// Adds each piece to the track that leads nearest to it, or begins a new one. A piece in which a second track ends up too is
/// both objects at once, and no one's.
fn link(tracks: &mut Vec<Vec<Piece>>, pieces: Vec<Piece>) {
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (i, track) in tracks.iter().enumerate() {
        for (j, piece) in pieces.iter().enumerate() {
            let distance = expected(track, piece.centre.t).distance(piece.centre.position);
            // An object is found again when it is off its way by no more than its own size.
            if distance <= track.last().map_or(0.0, |last| last.size.max(piece.size)) {
                pairs.push((distance, i, j));
            }
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut takers: Vec<Option<usize>> = vec![None; pieces.len()];
    let mut taken = vec![false; tracks.len()];
    for (_, i, j) in &pairs {
        if !taken[*i] && takers[*j].is_none() {
            (taken[*i], takers[*j]) = (true, Some(*i));
        }
    }
    let is_both = |j: usize| pairs.iter().any(|(_, i, at)| *at == j && !taken[*i] && tracks[*i].len() >= STEADY);
    let both: Vec<bool> = (0..pieces.len()).map(is_both).collect();
    for (j, piece) in pieces.into_iter().enumerate() {
        match takers[j] {
            Some(_) if both[j] => {}
            Some(i) => tracks[i].push(piece),
            None => tracks.push(vec![piece]),
        }
    }
}

/// Where a track goes on straight to at a time.
fn expected(track: &[Piece], t: f64) -> DVec3 {
    match track {
        [] => DVec3::NAN,
        [only] => only.centre.position,
        [.., a, b] => {
            let (a, b) = (&a.centre, &b.centre);
            b.position + (b.position - a.position) * ((t - b.t) / (b.t - a.t))
        }
    }
}

/// The objects of one time.
fn pieces(views: &[View], masks: &[Option<Vec<u8>>], solid: &Solid, t: f64) -> Vec<Piece> {
    let voxels = &solid.voxels;
    let (labels, counts) = label(voxels);
    let largest = counts.iter().copied().max().unwrap_or(0) as f64;
    let real: Vec<usize> = (0..counts.len()).filter(|i| counts[*i] as f64 >= PHANTOM * largest).collect();
    let mut spots: Vec<Vec<(Spot, &View)>> = counts.iter().map(|_| Vec::new()).collect();
    for (silhouette, index) in solid.silhouettes.iter().zip(&solid.views) {
        let Some(mask) = mask_of(views, masks, *index) else { continue };
        let view = &views[*index];
        let size = (view.width, view.height);
        let found = regions(size, true, |pixel| mask[pixel] != 0);
        // Per region and piece, how many voxels project there.
        let mut hits = vec![vec![0_usize; counts.len()]; found.list.len()];
        for cell in voxels.cells() {
            let piece = labels[voxels.index(cell)] as usize;
            let seen = silhouette.camera.sees(voxels.place(cell));
            let region = seen.map_or(NOWHERE, |(pixel, _)| found.labels[pixel]);
            if region != NOWHERE {
                hits[region as usize][piece] += 1;
            }
        }
        for piece in &real {
            let own: Vec<bool> = hits
                .iter()
                .map(|row| row[*piece] > 0 && row[*piece] as f64 >= OWNED * row.iter().sum::<usize>() as f64)
                .collect();
            let shown: usize = hits.iter().zip(&own).filter(|(_, own)| **own).map(|(row, _)| row[*piece]).sum();
            if (shown as f64) < SHOWN * counts[*piece] as f64 {
                continue;
            }
            let pixels =
                (0..mask.len()).filter(|pixel| found.labels[*pixel] != NOWHERE && own[found.labels[*pixel] as usize]);
            if let Some(spot) = Spot::of_pixels(pixels, size.0, size.1) {
                spots[*piece].push((spot, view));
            }
        }
    }
    let middles = middles(voxels, &labels, counts.len());
    real.iter()
        .map(|piece| {
            let size = voxels.edge * (counts[*piece] as f64).cbrt();
            let centre = match locate(&spots[*piece]) {
                Ok((position, residual_px, cameras)) => Centre { t, position, residual_px, cameras },
                // Too few cameras show it alone: the middle of its piece of the hull, good to about a voxel.
                Err(_) => {
                    let position = middles[*piece];
                    let voxel = solid.silhouettes.iter().filter_map(|one| {
                        one.camera.project(position).map(|(_, depth)| voxels.edge * one.camera.focal() / depth)
                    });
                    Centre { t, position, residual_px: voxel.fold(0.0, f64::max), cameras: solid.silhouettes.len() }
                }
            };
            Piece { centre, size }
        })
        .collect()
}

/// For each cube the number of its piece, [`NOWHERE`] if not filled, and how many cubes each piece has.
fn label(voxels: &Voxels) -> (Vec<u32>, Vec<usize>) {
    let mut labels = vec![NOWHERE; voxels.filled.len()];
    let mut counts = Vec::new();
    let mut stack: Vec<UVec3> = Vec::new();
    for start in voxels.cells() {
        if labels[voxels.index(start)] != NOWHERE {
            continue;
        }
        let piece = counts.len() as u32;
        counts.push(0);
        labels[voxels.index(start)] = piece;
        stack.push(start);
        while let Some(cell) = stack.pop() {
            counts[piece as usize] += 1;
            for next in voxels.around(cell, true) {
                let index = voxels.index(next);
                if voxels.filled[index] && labels[index] == NOWHERE {
                    labels[index] = piece;
                    stack.push(next);
                }
            }
        }
    }
    (labels, counts)
}

fn middles(voxels: &Voxels, labels: &[u32], pieces: usize) -> Vec<DVec3> {
    let mut sums = vec![(DVec3::ZERO, 0.0); pieces];
    for cell in voxels.cells() {
        let sum = &mut sums[labels[voxels.index(cell)] as usize];
        sum.0 += voxels.place(cell);
        sum.1 += 1.0;
    }
    sums.into_iter().map(|(sum, count)| sum / count).collect()
}
