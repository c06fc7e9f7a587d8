//! One place from where several cameras see it, when some of them may be wrong.

use glam::{DMat3, DVec2, DVec3};

use crate::geometry::Pinhole;

/// Least sine of the angle between two rays that fix a place (about one degree): at less, half a pixel moves it by
/// its whole distance at usual focal lengths.
const SINE_MIN: f64 = 0.02;

/// Most pairs of rays that are tried; bounds the work with many cameras.
const PAIRS_MAX: usize = 1000;

/// Steps of Gauss-Newton. Three reach rounding from a pair's midpoint.
const STEPS: usize = 8;

/// Where one camera sees something.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sight {
    pub camera: Pinhole,
    /// Pixel coordinate.
    pub pixel: DVec2,
    /// How far off it may be and still mean the same place, pixels.
    pub slack: f64,
}

/// A place and how well the sights agree with it.
#[derive(Debug, Clone)]
pub(crate) struct Place {
    pub position: DVec3,
    /// Root mean square distance of the inliers from its projections, pixels.
    pub residual: f64,
    /// The sights that agree, by number.
    pub inliers: Vec<usize>,
}

/// The place that most sights agree on, refined over them by least squares in pixels. An error says why there is none.
pub(crate) fn triangulate(sights: &[Sight]) -> Result<Place, &'static str> {
    if sights.len() < 2 {
        return Err("fewer than two cameras see it");
    }
    let pairs: Vec<(usize, usize)> =
        (0..sights.len()).flat_map(|a| (a + 1..sights.len()).map(move |b| (a, b))).collect();
    let best = pairs
        .iter()
        .step_by(pairs.len().div_ceil(PAIRS_MAX))
        .filter_map(|(a, b)| meeting(&sights[*a], &sights[*b]))
        .map(|position| (cost(sights, position), position))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, mut position)) = best else {
        return Err("the cameras see it from the same direction");
    };
    let mut inliers = agreeing(sights, position);
    for _ in 0..2 {
        if inliers.len() < 2 || 2 * inliers.len() < sights.len() {
            return Err("the cameras do not agree on one place");
        }
        position = refine(sights, &inliers, position);
        inliers = agreeing(sights, position);
    }
    if inliers.len() < 2 {
        return Err("the cameras do not agree on one place");
    }
    let sum: f64 = inliers.iter().map(|i| distance(&sights[*i], position).powi(2)).sum();
    Ok(Place { position, residual: (sum / inliers.len() as f64).sqrt(), inliers })
}

/// The midpoint of where two rays come closest; `None` when they are nearly parallel or it lies behind a camera.
fn meeting(a: &Sight, b: &Sight) -> Option<DVec3> {
    let (d, e) = (a.camera.direction(a.pixel), b.camera.direction(b.pixel));
    let across = d.cross(e);
    let sine2 = across.length_squared();
    if sine2.is_nan() || sine2 < SINE_MIN * SINE_MIN {
        return None;
    }
    let between = b.camera.centre - a.camera.centre;
    let along_a = between.cross(e).dot(across) / sine2;
    let along_b = between.cross(d).dot(across) / sine2;
    (along_a > 0.0 && along_b > 0.0)
        .then(|| 0.5 * (a.camera.centre + along_a * d + b.camera.centre + along_b * e))
        .filter(|place| place.is_finite())
}

/// Distance in pixels of a sight from a place's projection; infinite behind the camera.
fn distance(sight: &Sight, place: DVec3) -> f64 {
    sight.camera.project(place).map_or(f64::INFINITY, |(pixel, _)| pixel.distance(sight.pixel))
}

/// Squared distances over the slack, each at most 1, so that wrong sights cost the same however wrong they are.
fn cost(sights: &[Sight], place: DVec3) -> f64 {
    sights.iter().map(|sight| (distance(sight, place) / sight.slack).powi(2).min(1.0)).sum()
}

fn agreeing(sights: &[Sight], place: DVec3) -> Vec<usize> {
    (0..sights.len()).filter(|i| distance(&sights[*i], place) <= sights[*i].slack).collect()
}

/// Gauss-Newton on the squared pixel distances of the inliers; stays where it is when a step cannot be taken.
fn refine(sights: &[Sight], inliers: &[usize], start: DVec3) -> DVec3 {
    let mut place = start;
    for _ in 0..STEPS {
        let (mut normal, mut right) = (DMat3::ZERO, DVec3::ZERO);
        for sight in inliers.iter().map(|i| &sights[*i]) {
            let (Some((pixel, _)), Some(rows)) = (sight.camera.project(place), sight.camera.jacobian(place)) else {
                return start;
            };
            let off = sight.pixel - pixel;
            for (row, off) in rows.iter().zip([off.x, off.y]) {
                normal += DMat3::from_cols(*row * row.x, *row * row.y, *row * row.z);
                right += *row * off;
            }
        }
        let step = normal.inverse() * right;
        if !step.is_finite() {
            return start;
        }
        place += step;
    }
    if place.is_finite() { place } else { start }
}
