//! Visual hull of the moving object at one time, as coloured points.
//!
//! 1. The masks' centroids are triangulated, and a box is placed around that position, so that the object may be small.
//! 2. Views whose masks miss the core (the positions inside most masks) are left out.
//! 3. A coarse carving that keeps all possible voxels tightens the box, and a fine one finds the surface.
//!
//! The hull contains the object, up to ragged masks, and is larger: hollows that no camera sees through stay filled,
//! a rig on one side leaves it long in that direction, and masks of blurry photos add the path of one exposure.

use glam::{DVec3, UVec3};

use gs_datasets::{PointCloud, Scene, View};

use crate::cameras::{Instant, instants};
use crate::carve::{Consensus, Silhouette, Voxels, support};
use crate::centres::{Blob, locate, mask_of};
use crate::options::HullOptions;
use crate::pinhole::Pinhole;
use crate::pixels::{color, median_color};
use crate::regions::fill_holes;

/// Voxels along the box in the coarse carving. The object fills most of the box, so a limb of a tenth of it still
/// counts.
const COARSE: usize = 32;

/// Voxels along the tight box: at least enough for a surface accurate to a hundredth of the object, at most a few
/// megabytes.
const FINE: (usize, usize) = (56, 176);

/// Largest number of fine carvings.
const PASSES: usize = 3;

/// Margin of the first box around the masks, as a factor.
const MARGIN: f64 = 1.2;

/// Growth of a box that the object touches, as a factor, and the largest number of growths.
const GROWTH: (f64, i32) = (1.6, 5);

/// Holes in a mask up to this share of the region around them are filled before carving: each would be a tunnel.
const HOLE: f64 = 0.1;

/// A point is visible if no part of the hull is nearer by more than this many voxels.
const OCCLUDED: f64 = 2.0;

/// Visual hull of the moving object at one time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Hull {
    /// Points on its surface or throughout its volume, coloured with the median of the views that see them; inner
    /// points, which none sees, with that of the views that have them in their masks.
    pub points: PointCloud,
    /// Centroid of its volume; zero if empty.
    pub centre: DVec3,
    /// Smallest and largest coordinates; both zero if empty.
    pub bounds: (DVec3, DVec3),
    /// Volume, cubic scene units.
    pub volume: f64,
    /// Edge of a voxel, scene units: the accuracy of a point.
    pub spacing: f64,
    /// Number of views it was carved from.
    pub cameras: usize,
    /// Reasons for left out views or an empty hull, one sentence each.
    pub notes: Vec<String>,
}

/// Visual hull of all moving pixels at the time of a view nearest to `t`. `masks` holds one mask per training view.
/// Without enough masks the hull is empty and its notes say why.
pub fn hull(scene: &Scene, masks: &[Option<Vec<u8>>], t: f64, options: &HullOptions) -> Hull {
    let views = &scene.train;
    let instants = instants(views);
    let nearest = instants.iter().min_by(|a, b| (a.t - t).abs().total_cmp(&(b.t - t).abs()));
    let Some(instant) = nearest else {
        return Hull {
            notes: vec!["no training view has a time, so there is nothing to carve".into()],
            ..Hull::default()
        };
    };
    let mut notes = Vec::new();
    let gap = (instants[instants.len() - 1].t - instants[0].t) / (instants.len() - 1).max(1) as f64;
    if (instant.t - t).abs() > gap {
        notes.push(format!("no view was taken near time {t}; the hull is of time {}", instant.t));
    }
    let solid = match Solid::of(views, masks, instant, options) {
        Ok(solid) => solid,
        Err(reason) => {
            notes.push(format!("no hull at time {}: {reason}", instant.t));
            return Hull { notes, ..Hull::default() };
        }
    };
    notes.extend(solid.notes);
    let voxels = &solid.voxels;
    let surface = voxels.surface();
    let chosen = match options.filled {
        true => spread(&voxels.cells().collect::<Vec<_>>(), options.points),
        false => spread(&surface, options.points),
    };
    let positions: Vec<DVec3> = chosen.iter().map(|cell| voxels.position(*cell)).collect();
    let colors = colors(views, &solid.views, &solid.silhouettes, voxels, &surface, &positions);
    let count = voxels.cells().count() as f64;
    let edge = voxels.edge;
    let low = surface.iter().fold(DVec3::INFINITY, |low, cell| low.min(voxels.position(*cell) - 0.5 * edge));
    let high = surface.iter().fold(DVec3::NEG_INFINITY, |high, cell| high.max(voxels.position(*cell) + 0.5 * edge));
    Hull {
        points: PointCloud {
            positions: positions.iter().map(|position| position.as_vec3().to_array()).collect(),
            colors,
        },
        centre: voxels.cells().map(|cell| voxels.position(cell)).sum::<DVec3>() / count,
        bounds: (low, high),
        volume: count * edge.powi(3),
        spacing: edge,
        cameras: solid.silhouettes.len(),
        notes,
    }
}

/// Carved voxels and the silhouettes used.
pub(crate) struct Solid {
    /// At least one voxel is filled.
    pub voxels: Voxels,
    pub silhouettes: Vec<Silhouette>,
    /// Index of the view of each silhouette.
    pub views: Vec<usize>,
    pub notes: Vec<String>,
}

impl Solid {
    pub fn of(
        views: &[View],
        masks: &[Option<Vec<u8>>],
        instant: &Instant,
        options: &HullOptions,
    ) -> Result<Self, String> {
        let mut used: Vec<usize> =
            instant.views.iter().copied().filter(|index| mask_of(views, masks, *index).is_some()).collect();
        let blobs: Vec<(Blob, &View)> = used
            .iter()
            .filter_map(|index| Some((Blob::of(mask_of(views, masks, *index)?, views[*index].width)?, &views[*index])))
            .collect();
        let (middle, ..) = locate(&blobs)?;
        let mut silhouettes: Vec<Silhouette> = used
            .iter()
            .filter_map(|index| mask_of(views, masks, *index).map(|mask| silhouette(&views[*index], mask)))
            .collect();
        let first =
            reach(&silhouettes, middle, options.oversized).ok_or("the masks have no size around their centre")?;
        let mut notes = Vec::new();
        let wrong = contradicting(&silhouettes, middle - first, middle + first, options)?;
        if !wrong.is_empty() {
            let names: Vec<&str> = wrong.iter().map(|i| views[used[*i]].name.as_str()).collect();
            notes.push(format!("masks that contradict the others were left out: {}", names.join(", ")));
            for i in wrong.into_iter().rev() {
                silhouettes.remove(i);
                used.remove(i);
            }
        }
        let consensus = Consensus::of(silhouettes.len(), options);
        let (mut coarse, mut is_cut) = coarse(&silhouettes, consensus, middle, first)?;
        if is_cut {
            // Far behind the object a position in a few masks, and out of view of the other cameras, is not
            // contradicted.
            silhouettes.iter_mut().for_each(Silhouette::bound);
            match self::coarse(&silhouettes, consensus, middle, first) {
                Ok(bounded) => (coarse, is_cut) = bounded,
                // A mask with only a part of the object, whole within the image, would leave nothing of it.
                Err(_) => silhouettes.iter_mut().for_each(Silhouette::unbound),
            }
        }
        if is_cut {
            notes.push("the cameras do not bound the object on all sides; its hull is cut".to_string());
        }
        let voxels = fine(coarse, &silhouettes, consensus, options.points).ok_or(NOWHERE)?;
        Ok(Self { voxels, silhouettes, views: used, notes })
    }
}

/// Why there is no hull.
const NOWHERE: &str = "no position is in enough masks";

/// Coarse voxels in the smallest box around `middle` that the object does not touch, growing from half an edge of
/// `half`; and whether it touches the largest one.
fn coarse(
    silhouettes: &[Silhouette],
    consensus: Consensus,
    middle: DVec3,
    half: f64,
) -> Result<(Voxels, bool), &'static str> {
    let mut growths = 0;
    loop {
        let half = half * GROWTH.0.powi(growths);
        let mut voxels = Voxels::over(middle - half, middle + half, COARSE);
        voxels.carve(silhouettes, consensus, true);
        let (first, last) = span(&voxels).ok_or(NOWHERE)?;
        let touches = first.min_element() == 0 || last.cmpge(UVec3::splat(COARSE as u32 - 1)).any();
        if !touches || growths == GROWTH.1 {
            return Ok((voxels, touches));
        }
        growths += 1;
    }
}

/// Carves at growing resolution until the surface has enough voxels: the box tightens with every pass, and the size
/// of the surface is only known afterwards.
fn fine(coarse: Voxels, silhouettes: &[Silhouette], consensus: Consensus, points: usize) -> Option<Voxels> {
    let mut voxels = coarse;
    let mut resolution = FINE.0;
    for pass in 1.. {
        let (first, last) = span(&voxels)?;
        // Carving by voxel centres may miss half a voxel beyond them.
        let margin = if pass == 1 { 0.0 } else { 1.0 };
        let low = voxels.low + voxels.edge * (first.as_dvec3() - margin);
        let high = voxels.low + voxels.edge * (last.as_dvec3() + 1.0 + margin);
        voxels = Voxels::over(low, high, resolution);
        voxels.carve(silhouettes, consensus, false);
        let surface = voxels.surface().len();
        let (first, last) = span(&voxels)?;
        let longest = (last - first).max_element() as usize + 1;
        if pass == PASSES || (surface >= points && longest >= FINE.0 * 3 / 4) {
            break;
        }
        // The surface grows with the square of the resolution; 10 % more avoids a third pass.
        let wanted = 1.1 * longest as f64 * (points as f64 / surface.max(1) as f64).sqrt().max(1.0);
        resolution = (wanted.ceil() as usize).clamp(FINE.0, FINE.1);
    }
    Some(voxels)
}

fn silhouette(view: &View, mask: &[u8]) -> Silhouette {
    let mut mask: Vec<bool> = mask.iter().map(|value| *value != 0).collect();
    fill_holes(&mut mask, (view.width, view.height), HOLE);
    Silhouette::new(Pinhole::new(view), &mask)
}

/// Half the edge of a box around `middle` that holds all mask pixels; `None` if all masks are empty.
fn reach(silhouettes: &[Silhouette], middle: DVec3, oversized: f64) -> Option<f64> {
    let mut reaches: Vec<f64> = silhouettes.iter().filter_map(|silhouette| silhouette.reach(middle)).collect();
    reaches.sort_by(|a, b| b.total_cmp(a));
    let reach = *reaches.get((oversized * reaches.len() as f64) as usize)?;
    (reach.is_finite() && reach > 0.0).then_some(MARGIN * reach)
}

/// Indices of the silhouettes that miss the core: the positions in the box that most cameras have in their masks.
fn contradicting(
    silhouettes: &[Silhouette],
    low: DVec3,
    high: DVec3,
    options: &HullOptions,
) -> Result<Vec<usize>, String> {
    let grid = Voxels::over(low, high, COARSE);
    let seen_min = Consensus::of(silhouettes.len(), options).seen_min;
    let shares: Vec<(DVec3, f64)> = (0..grid.filled.len())
        .map(|index| grid.position(grid.cell(index)))
        .filter_map(|position| {
            let (hits, seen) = support(silhouettes, position);
            (seen >= seen_min).then(|| (position, hits as f64 / seen as f64))
        })
        .collect();
    let best = shares.iter().map(|(_, share)| *share).fold(0.0, f64::max);
    if best < options.agreement {
        return Err(format!("at most {:.0} % of the cameras that see a position have it in their masks", 100.0 * best));
    }
    let core: Vec<DVec3> =
        shares.iter().filter(|(_, share)| *share >= best - 1e-9).map(|(position, _)| *position).collect();
    let misses_core = |silhouette: &Silhouette| {
        let answers: Vec<bool> = core.iter().filter_map(|position| silhouette.contains(*position)).collect();
        let hits = answers.iter().filter(|hit| **hit).count();
        // A camera that sees nothing of the core does not contradict.
        !answers.is_empty() && (hits as f64) < options.believed * answers.len() as f64
    };
    Ok((0..silhouettes.len()).filter(|i| misses_core(&silhouettes[*i])).collect())
}

/// First and last filled voxel along each axis.
fn span(voxels: &Voxels) -> Option<(UVec3, UVec3)> {
    voxels.cells().map(|cell| (cell, cell)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)))
}

/// At most `count` of `voxels`, evenly over them: every n-th along a Morton curve, which keeps neighbours together.
fn spread(voxels: &[UVec3], count: usize) -> Vec<UVec3> {
    let mut sorted = voxels.to_vec();
    sorted.sort_by_key(|cell| {
        (0..8).fold(0_u32, |key, bit| {
            let [x, y, z] = cell.to_array().map(|value| value >> bit & 1);
            key | (x | y << 1 | z << 2) << (3 * bit)
        })
    });
    if count >= sorted.len() {
        return sorted;
    }
    (0..count).map(|i| sorted[i * sorted.len() / count]).collect()
}

/// Median colour over the views that see each position; over all views with it in the image if it is hidden in all.
fn colors(
    views: &[View],
    used: &[usize],
    silhouettes: &[Silhouette],
    voxels: &Voxels,
    surface: &[UVec3],
    positions: &[DVec3],
) -> Vec<[u8; 3]> {
    let surface: Vec<DVec3> = surface.iter().map(|cell| voxels.position(*cell)).collect();
    let depths: Vec<Vec<f64>> = silhouettes.iter().map(|one| depth_map(one, &surface, voxels.edge)).collect();
    let seen_by = |position: DVec3, slack: f64| -> Vec<[u8; 3]> {
        let looks = silhouettes.iter().zip(&depths).zip(used).filter_map(|((one, nearest), index)| {
            let (pixel, depth) = one.camera.project(position)?;
            let (x, y) = one.camera.pixel(pixel)?;
            let view = &views[*index];
            let at = y * view.width + x;
            let is_there = 3 * at + 3 <= view.image.data.len();
            let visible = is_there && depth <= nearest[at] + slack && one.contains(position) == Some(true);
            visible.then(|| color(view, at))
        });
        looks.collect()
    };
    positions
        .iter()
        .map(|position| {
            let mut seen = seen_by(*position, OCCLUDED * voxels.edge);
            if seen.is_empty() {
                seen = seen_by(*position, f64::INFINITY);
            }
            median_color(&seen).unwrap_or([128; 3])
        })
        .collect()
}

/// Depth of the nearest voxel at each pixel; infinite without one.
fn depth_map(silhouette: &Silhouette, positions: &[DVec3], edge: f64) -> Vec<f64> {
    let camera = &silhouette.camera;
    let mut nearest = vec![f64::INFINITY; camera.width * camera.height];
    for position in positions {
        let Some((pixel, depth)) = camera.project(*position) else { continue };
        let half = 0.5 * edge * camera.focal() / depth;
        let span = |at: f64, size: usize| {
            let clip = |value: f64| value.clamp(0.0, size as f64) as usize;
            clip((at - half).floor())..clip((at + half).ceil())
        };
        for y in span(pixel.y, camera.height) {
            for x in span(pixel.x, camera.width) {
                let at = &mut nearest[y * camera.width + x];
                *at = at.min(depth);
            }
        }
    }
    nearest
}
