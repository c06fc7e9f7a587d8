//! Robust triangulation: one position from several cameras, some of which may be wrong.

use glam::{DMat3, DVec2, DVec3};

use crate::pinhole::Pinhole;

/// Smallest sine of the angle between two rays (about one degree). Below it, half a pixel moves the intersection by
/// its whole distance at usual focal lengths.
const SINE_MIN: f64 = 0.02;

/// Largest number of pairs of rays tried; bounds the work with many cameras.
const PAIRS_MAX: usize = 1000;

/// Steps of Gauss-Newton. Three reach rounding error from a pair's midpoint.
const STEPS: usize = 8;

/// Ray of one camera through a pixel.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ray {
    pub camera: Pinhole,
    /// Pixel coordinate.
    pub pixel: DVec2,
    /// Largest distance from the projection of the same point, pixels.
    pub tolerance: f64,
}

/// Triangulated position with its inliers.
#[derive(Debug, Clone)]
pub(crate) struct Triangulated {
    pub position: DVec3,
    /// Root mean square distance of the inliers' pixels from its projections, pixels.
    pub residual: f64,
    /// Indices of the rays that agree.
    pub inliers: Vec<usize>,
}

/// Position on which most rays agree, refined over them by least squares in pixels. The error is the reason why there
/// is none.
pub(crate) fn triangulate(rays: &[Ray]) -> Result<Triangulated, &'static str> {
    if rays.len() < 2 {
        return Err("fewer than two cameras see it");
    }
    let pairs: Vec<(usize, usize)> = (0..rays.len()).flat_map(|a| (a + 1..rays.len()).map(move |b| (a, b))).collect();
    let best = pairs
        .iter()
        .step_by(pairs.len().div_ceil(PAIRS_MAX))
        .filter_map(|(a, b)| meeting(&rays[*a], &rays[*b]))
        .map(|position| (cost(rays, position), position))
        .min_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, mut position)) = best else {
        return Err("the cameras see it from the same direction");
    };
    let mut inliers = agreeing(rays, position);
    for _ in 0..2 {
        if inliers.len() < 2 || 2 * inliers.len() < rays.len() {
            return Err("the cameras do not agree on one position");
        }
        position = refine(rays, &inliers, position);
        inliers = agreeing(rays, position);
    }
    if inliers.len() < 2 {
        return Err("the cameras do not agree on one position");
    }
    let sum: f64 = inliers.iter().map(|i| distance(&rays[*i], position).powi(2)).sum();
    Ok(Triangulated { position, residual: (sum / inliers.len() as f64).sqrt(), inliers })
}

/// Midpoint between the closest points of two rays; `None` if they are nearly parallel or it lies behind a camera.
fn meeting(a: &Ray, b: &Ray) -> Option<DVec3> {
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
        .filter(|position| position.is_finite())
}

/// Distance of a ray's pixel from the projected position, pixels; infinite behind the camera.
fn distance(ray: &Ray, position: DVec3) -> f64 {
    ray.camera.project(position).map_or(f64::INFINITY, |(pixel, _)| pixel.distance(ray.pixel))
}

/// Squared distances over the tolerance, each at most 1, so that all outliers cost the same.
fn cost(rays: &[Ray], position: DVec3) -> f64 {
    rays.iter().map(|ray| (distance(ray, position) / ray.tolerance).powi(2).min(1.0)).sum()
}

fn agreeing(rays: &[Ray], position: DVec3) -> Vec<usize> {
    (0..rays.len()).filter(|i| distance(&rays[*i], position) <= rays[*i].tolerance).collect()
}

/// Gauss-Newton on the squared pixel distances of the inliers; returns `start` if a step is singular.
fn refine(rays: &[Ray], inliers: &[usize], start: DVec3) -> DVec3 {
    let mut position = start;
    for _ in 0..STEPS {
        let (mut normal, mut right) = (DMat3::ZERO, DVec3::ZERO);
        for ray in inliers.iter().map(|i| &rays[*i]) {
            let (Some((pixel, _)), Some(rows)) = (ray.camera.project(position), ray.camera.jacobian(position)) else {
                return start;
            };
            let off = ray.pixel - pixel;
            for (row, off) in rows.iter().zip([off.x, off.y]) {
                normal += DMat3::from_cols(*row * row.x, *row * row.y, *row * row.z);
                right += *row * off;
            }
        }
        let step = normal.inverse() * right;
        if !step.is_finite() {
            return start;
        }
        position += step;
    }
    if position.is_finite() { position } else { start }
}
