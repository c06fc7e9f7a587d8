//! Centre of the moving object over time, and its velocity: the guide of TaylorMoDe-GS, Eq. 17.
//!
//! ```text
//! L_vel = || M_dyn * (v_cam - v_guide) ||_1                                                              (17)
//! v_guide(t_i) = (c(t_{i+1}) - c(t_{i-1})) / (t_{i+1} - t_{i-1}),   c(t): triangulated centre of the masks at t
//! ```
//!
//! The paper says "object center displacement" and no more. Here the centre is the position whose projections meet the
//! masks' centroids in as many cameras as possible, so that an occluded or wrong mask does not pull it. The centroid of
//! a silhouette is not the projection of the object's centroid, but for a rigid object without rotation the difference
//! is nearly constant and cancels in the velocity. `v_guide` is in world axes; the caller rotates it into each camera.

use glam::{DVec2, DVec3};

use gs_datasets::{Scene, View};

use crate::cameras::instants;
use crate::pinhole::Pinhole;
use crate::triangulate::{Ray, triangulate};

/// Smallest number of mask pixels with a usable centroid.
const AREA_MIN: usize = 4;

/// Largest distance of a centroid from the projected position: pixels (a mask's edge is off by one or two at any
/// resolution), and a share of the mask's root mean square radius (half of it occluded moves the centroid by about
/// that much).
const TOLERANCE: (f64, f64) = (2.0, 0.5);

/// Centre of the moving object at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Centre {
    /// Time, as [`View::time`].
    pub t: f64,
    /// Position in the world of [`View::c2w`], scene units.
    pub position: DVec3,
    /// Root mean square distance of its projections from the masks' centroids, pixels.
    pub residual_px: f64,
    /// Number of cameras that agree on it.
    pub cameras: usize,
}

/// Centres over time, and the reasons for missing ones.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Centres {
    /// By time, earliest first.
    pub centres: Vec<Centre>,
    /// Reasons for times without a centre, one sentence each.
    pub notes: Vec<String>,
}

/// Centre of all moving pixels at each time at which masks of at least two cameras agree. `masks` holds one mask per
/// training view, as [`moving_masks`](crate::moving_masks) returns them; masks of a wrong size are ignored.
pub fn centres(scene: &Scene, masks: &[Option<Vec<u8>>]) -> Centres {
    let views = &scene.train;
    let mut found = Centres::default();
    let instants = instants(views);
    if instants.is_empty() {
        found.notes.push("no training view has a time, so there is no centre to follow".to_string());
        return found;
    }
    let mut reasons: Vec<(&'static str, usize)> = Vec::new();
    for instant in &instants {
        let blobs: Vec<(Blob, &View)> = instant
            .views
            .iter()
            .filter_map(|index| Some((Blob::of(mask_of(views, masks, *index)?, views[*index].width)?, &views[*index])))
            .collect();
        match locate(&blobs) {
            Ok((position, residual_px, cameras)) => {
                found.centres.push(Centre { t: instant.t, position, residual_px, cameras });
            }
            Err(reason) => match reasons.iter_mut().find(|(known, _)| *known == reason) {
                Some((_, count)) => *count += 1,
                None => reasons.push((reason, 1)),
            },
        }
    }
    for (reason, count) in reasons {
        found.notes.push(format!("no centre of the moving object at {count} of {} times: {reason}", instants.len()));
    }
    found
}

/// Velocity of the centre at a time, scene units per unit of time: the derivative of the parabola through the three
/// nearest centres (the central difference, at an inner centre of even spacing), or the difference of two. `None`
/// with fewer than two centres, or farther outside their times than their mean spacing.
pub fn guide_velocity(centres: &[Centre], t: f64) -> Option<DVec3> {
    let (first, last) = (centres.first()?, centres.last()?);
    let gap = (last.t - first.t) / (centres.len() as f64 - 1.0);
    // Also refuses NaN, and a single centre (0 / 0).
    if !(t >= first.t - gap && t <= last.t + gap && gap > 0.0) {
        return None;
    }
    if let [a, b] = centres {
        return Some((b.position - a.position) / (b.t - a.t));
    }
    let nearest = (0..centres.len()).min_by(|a, b| (centres[*a].t - t).abs().total_cmp(&(centres[*b].t - t).abs()))?;
    let middle = nearest.clamp(1, centres.len() - 2);
    let [a, b, c] = [middle - 1, middle, middle + 1].map(|i| &centres[i]);
    // Lagrange's parabola, differentiated.
    let weight = |own: f64, p: f64, q: f64| (2.0 * t - p - q) / ((own - p) * (own - q));
    let velocity =
        weight(a.t, b.t, c.t) * a.position + weight(b.t, a.t, c.t) * b.position + weight(c.t, a.t, b.t) * c.position;
    velocity.is_finite().then_some(velocity)
}

/// Mask of a view, if it has the view's size.
pub(crate) fn mask_of<'a>(views: &[View], masks: &'a [Option<Vec<u8>>], index: usize) -> Option<&'a [u8]> {
    let mask = masks.get(index)?.as_deref()?;
    (mask.len() == views[index].width * views[index].height).then_some(mask)
}

/// Centroid and spread of a set of pixels.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Blob {
    /// Mean of the pixels' centres.
    pub centroid: DVec2,
    /// Root mean square distance from the centroid, pixels.
    pub spread: f64,
    /// Whether it touches the image's edge, so that a part is probably missing.
    pub is_cut: bool,
}

impl Blob {
    /// `None` with fewer than [`AREA_MIN`] pixels set. `width` is the image's.
    pub fn of(mask: &[u8], width: usize) -> Option<Self> {
        let set = mask.iter().enumerate().filter(|(_, value)| **value != 0).map(|(pixel, _)| pixel);
        Self::of_pixels(set, width, mask.len().checked_div(width)?)
    }

    /// The same from pixel indices.
    pub fn of_pixels(pixels: impl Iterator<Item = usize>, width: usize, height: usize) -> Option<Self> {
        let (mut count, mut sum, mut squares, mut is_cut) = (0_usize, DVec2::ZERO, 0.0, false);
        for pixel in pixels {
            let (x, y) = (pixel % width, pixel / width);
            let at = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
            count += 1;
            sum += at;
            squares += at.length_squared();
            is_cut |= x == 0 || y == 0 || x + 1 == width || y + 1 == height;
        }
        if count < AREA_MIN {
            return None;
        }
        let centroid = sum / count as f64;
        let variance = squares / count as f64 - centroid.length_squared();
        Some(Self { centroid, spread: variance.max(0.0).sqrt(), is_cut })
    }
}

/// Position, residual (pixels) and number of agreeing cameras of one object at one time.
pub(crate) fn locate(blobs: &[(Blob, &View)]) -> Result<(DVec3, f64, usize), &'static str> {
    let rays = |with_cut: bool| -> Vec<Ray> {
        blobs
            .iter()
            .filter(|(blob, _)| with_cut || !blob.is_cut)
            .map(|(blob, view)| Ray {
                camera: Pinhole::new(view),
                pixel: blob.centroid,
                tolerance: TOLERANCE.0 + TOLERANCE.1 * blob.spread,
            })
            .collect()
    };
    // A blob at the image's edge has a biased centroid, so it counts only if the others are too few.
    let position = triangulate(&rays(false)).or_else(|_| triangulate(&rays(true)))?;
    Ok((position.position, position.residual, position.inliers.len()))
}
