//! COLMAP's models of wide lenses, forward and backward.

use glam::{DVec2, DVec3};

/// COLMAP's formulas, written apart from the crate's: the pixel that shows a direction.
pub fn shown(model: i32, params: &[f64], direction: DVec3) -> DVec2 {
    let theta = direction.x.hypot(direction.y).atan2(direction.z);
    let (sin, cos) = direction.y.atan2(direction.x).sin_cos();
    let polynomial =
        |k: [f64; 4]| theta + k[0] * theta.powi(3) + k[1] * theta.powi(5) + k[2] * theta.powi(7) + k[3] * theta.powi(9);
    let at = |focal: [f64; 2], centre: [f64; 2], radius: f64| {
        DVec2::new(focal[0] * radius * cos + centre[0], focal[1] * radius * sin + centre[1])
    };
    match (model, params) {
        (5, &[fx, fy, cx, cy, k1, k2, k3, k4]) => at([fx, fy], [cx, cy], polynomial([k1, k2, k3, k4])),
        (7, &[fx, fy, cx, cy, w]) => {
            let radius = (2.0 * theta.sin() * (0.5 * w).tan()).atan2(theta.cos()) / w;
            at([fx, fy], [cx, cy], radius)
        }
        (8, &[f, cx, cy, k]) => at([f, f], [cx, cy], polynomial([k, 0.0, 0.0, 0.0])),
        (9, &[f, cx, cy, k1, k2]) => at([f, f], [cx, cy], polynomial([k1, k2, 0.0, 0.0])),
        (10, &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, s1, s2]) => {
            let (x, y, r2) = (theta * cos, theta * sin, theta * theta);
            let radial = polynomial([k1, k2, k3, k4]);
            let u = radial * cos + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + s1 * r2;
            let v = radial * sin + 2.0 * p2 * x * y + p1 * (r2 + 2.0 * y * y) + s2 * r2;
            DVec2::new(fx * u + cx, fy * v + cy)
        }
        (14, &[f, cx, cy]) => at([f, f], [cx, cy], theta),
        (15, &[fx, fy, cx, cy]) => at([fx, fy], [cx, cy], theta),
        (17, &[w, h]) => {
            let DVec3 { x, y, z } = direction.normalize();
            DVec2::new(w * (0.5 + x.atan2(z) / std::f64::consts::TAU), h * (0.5 + y.asin() / std::f64::consts::PI))
        }
        _ => panic!("model {model} of {params:?}"),
    }
}

/// The direction that a pixel shows, by Newton's iteration over the angles to right and down; `None` where the model
/// has none.
pub fn direction(model: i32, params: &[f64], pixel: DVec2) -> Option<DVec3> {
    if let (17, &[w, h]) = (model, params) {
        let (turn, down) = ((pixel.x / w - 0.5) * std::f64::consts::TAU, (pixel.y / h - 0.5) * std::f64::consts::PI);
        return Some(DVec3::new(turn.sin() * down.cos(), down.sin(), turn.cos() * down.cos()));
    }
    let ray = |angles: DVec2| {
        let theta = angles.length();
        let across = if theta > 0.0 { angles * theta.sin() / theta } else { DVec2::ZERO };
        across.extend(theta.cos())
    };
    let offset = |angles: DVec2| shown(model, params, ray(angles)) - pixel;
    let middle = shown(model, params, DVec3::Z);
    let mut angles = (pixel - middle) / params[0];
    for _ in 0..30 {
        const STEP: f64 = 1e-6;
        let error = offset(angles);
        let (x, y) =
            ((offset(angles + STEP * DVec2::X) - error) / STEP, (offset(angles + STEP * DVec2::Y) - error) / STEP);
        angles -= DVec2::new(y.y * error.x - y.x * error.y, x.x * error.y - x.y * error.x) / (x.x * y.y - x.y * y.x);
    }
    (offset(angles).length() < 1e-3 && angles.length() < std::f64::consts::PI).then(|| ray(angles))
}
