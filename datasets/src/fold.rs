//! Lens models that are no lens's. One that folds turns back beyond some radius, and shows the inside of the photo a
//! second time; one that stretches squeezes the photo into a spot of the ideal image. A calibration that diverged does
//! either in the middle of the photo.

use gs_base::Intrinsics;

use crate::distortion::Distortion;
use crate::projection::Projection;

/// Largest share of a photo that may lie beyond the fold. A tenth is what lies in the corners, beyond 0.8 of half the
/// diagonal: few points are matched there, so that the lens of a sound photo may turn back there, and these pixels are
/// left out. A lens that folds further in contradicts photos that show something there.
const SHARE_MAX: f64 = 0.1;

/// Least radius of what a fisheye photo shows, as a share of half its shorter side, if more than [`SHARE_MAX`] lies
/// beyond the fold: such photos are dark around a circle, and a calibration says nothing of what is dark.
const CIRCLE_MIN: f64 = 0.5;

/// Directions from the principal point in which a lens with tangential distortion is looked at; without it all are
/// alike.
const DIRECTIONS: usize = 32;

/// Steps from the principal point to the farthest corner.
const STEPS: usize = 256;

/// Farthest ideal radius that is looked at, in those of the farthest corner: a wide lens squeezes far more than its
/// corner's radius into the photo.
const FARTHEST: usize = 8;

/// Halvings of the step that holds the fold.
const HALVINGS: usize = 20;

/// Points along each side of the photo at which it is measured.
const GRID: usize = 48;

/// Largest magnification of the farthest corner. The strongest lenses of photos have some 1.3; at 2 three quarters of
/// the ideal image are empty.
const STRETCH_MAX: f64 = 2.0;

/// A fault of a lens.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Fault {
    /// More of the photo lies beyond a fold than corners.
    Folds {
        /// Where the photo shows the nearest of the fold: distance from the principal point, focal lengths.
        radius: f64,
        /// Share of the photo that lies beyond.
        share: f64,
    },
    /// The corner is shown this many times farther out than it is.
    Stretches(f64),
}

/// The fault of a lens for a photo of `size` pixels.
pub(crate) fn fault(
    projection: Projection,
    distortion: &Distortion,
    intrinsics: Intrinsics,
    size: (f64, f64),
) -> Option<Fault> {
    if distortion.is_none() {
        return None;
    }
    let Intrinsics { fx, fy, cx, cy } = intrinsics;
    let far = |side: f64, c: f64, f: f64| (c / f).abs().max(((side - c) / f).abs());
    let corner = far(size.0, cx, fx).hypot(far(size.1, cy, fy));
    let directions = if distortion.is_radial() { 1 } else { DIRECTIONS };
    let angle = |index: usize| std::f64::consts::TAU * index as f64 / directions as f64;
    let ends: Vec<End> =
        (0..directions).map(|index| along(distortion, angle(index), corner, projection.reach())).collect();
    let reach: Vec<f64> =
        ends.iter().map(|end| if let End::Fold(radius) = end { *radius } else { f64::INFINITY }).collect();
    let radius = reach.iter().copied().fold(f64::INFINITY, f64::min);
    if radius == f64::INFINITY {
        let stretch = |end: &End| if let End::Corner(ideal) = end { corner / ideal } else { 0.0 };
        let most = ends.iter().map(stretch).fold(0.0, f64::max);
        return (most > STRETCH_MAX).then_some(Fault::Stretches(most));
    }
    let at = |index: usize, side: f64, c: f64, f: f64| (((index as f64 + 0.5) / GRID as f64) * side - c) / f;
    let is_beyond = |x: f64, y: f64| {
        let turn = y.atan2(x).rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU;
        x.hypot(y) > reach[(turn * directions as f64).round() as usize % directions]
    };
    let points = (0..GRID * GRID).map(|i| (at(i % GRID, size.0, cx, fx), at(i / GRID, size.1, cy, fy)));
    let share = points.filter(|(x, y)| is_beyond(*x, *y)).count() as f64 / (GRID * GRID) as f64;
    let circle = CIRCLE_MIN * 0.5 * (size.0 / fx).min(size.1 / fy);
    let is_circle = projection != Projection::Pinhole && radius >= circle;
    (share > SHARE_MAX && !is_circle).then_some(Fault::Folds { radius, share })
}

/// The end of the part of the ideal image, in one direction, that the photo can show.
enum End {
    /// The lens folds; the radius at which the photo shows it.
    Fold(f64),
    /// The photo's farthest corner is reached; the ideal radius.
    Corner(f64),
    /// Neither, in all that is looked at.
    None,
}

/// `reach` is the farthest ideal radius that there is.
fn along(distortion: &Distortion, angle: f64, corner: f64, reach: f64) -> End {
    let (y, x) = angle.sin_cos();
    let observed = |r: f64| {
        let (x, y) = distortion.apply(x * r, y * r);
        x.hypot(y)
    };
    // A pole of the rational form is no number and counts as a fold.
    let is_sound = |r: f64| distortion.determinant(x * r, y * r) > 0.0;
    let step = corner / STEPS as f64;
    let mut sound = 0.0;
    for index in 1..=FARTHEST * STEPS {
        let r = step * index as f64;
        if r > reach {
            return End::None;
        }
        if is_sound(r) {
            sound = r;
            if observed(r) > corner {
                return End::Corner(r);
            }
            continue;
        }
        let mut folded = r;
        for _ in 0..HALVINGS {
            let middle = 0.5 * (sound + folded);
            if is_sound(middle) { sound = middle } else { folded = middle }
        }
        let radius = observed(sound);
        return if radius > corner { End::Corner(sound) } else { End::Fold(radius) };
    }
    End::None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A photo of 200 x 150 pixels; its corners are at a radius of 1.25.
    const PHOTO: Intrinsics = Intrinsics { fx: 100.0, fy: 100.0, cx: 100.0, cy: 75.0 };

    fn found(k: [f64; 4], d: [f64; 3], p: [f64; 2]) -> Option<Fault> {
        let distortion = Distortion { k, d, p, ..Distortion::default() };
        fault(Projection::Pinhole, &distortion, PHOTO, (200.0, 150.0))
    }

    fn fold(k1: f64) -> (f64, f64) {
        match found([k1, 0.0, 0.0, 0.0], [0.0; 3], [0.0; 2]) {
            Some(Fault::Folds { radius, share }) => (radius, share),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_fold_by_hand() {
        // r (1 + k r^2) turns at r = 1 / sqrt(-3 k), which is seen at two thirds of it.
        for k in [-45.0, -1.0, -1e4] {
            let (radius, expected) = (fold(k).0, 2.0 / 3.0 / (-3.0 * k).sqrt());
            assert!((radius / expected - 1.0).abs() < 1e-3, "{k}: {radius} against {expected}");
        }
        // A disc of 0.385 focal lengths in a photo of 2 x 1.5: the rest is beyond.
        let share = fold(-1.0).1;
        assert!((share - (1.0 - std::f64::consts::PI * 0.3849_f64.powi(2) / 3.0)).abs() < 0.01, "{share}");
    }

    #[test]
    fn every_coefficient_is_looked_at() {
        let none = ([0.0; 4], [0.0; 3], [0.0; 2]);
        for index in 0..4 {
            let (mut k, d, p) = none;
            k[index] = -40.0;
            assert!(matches!(found(k, d, p), Some(Fault::Folds { .. })), "k{}", index + 1);
            k[index] = 1e6;
            assert!(matches!(found(k, d, p), Some(Fault::Stretches(_))), "k{}", index + 1);
        }
        for index in 0..3 {
            let (k, mut d, p) = none;
            // The denominator grows faster than the radius, or has a pole.
            for value in [40.0, -40.0] {
                d[index] = value;
                assert!(found(k, d, p).is_some(), "d{} {value}", index + 1);
            }
        }
        for index in 0..2 {
            let (k, d, mut p) = none;
            p[index] = 0.9;
            assert!(found(k, d, p).is_some(), "p{}", index + 1);
        }
        assert!(found([1e300, -1e300, 0.0, 0.0], [0.0; 3], [0.0; 2]).is_some());
    }

    #[test]
    fn lenses_of_sound_cameras_stay() {
        for k in [
            [0.0; 4],
            [0.1, 0.0, 0.0, 0.0],
            [-0.05, 0.0, 0.0, 0.0],
            // An action camera by OpenCV's calibration.
            [-0.26, 0.08, 0.0, 0.0],
            // Folds at 1.19, in the corners' last twentieth.
            [-0.105, 0.0, 0.0, 0.0],
        ] {
            assert_eq!(found(k, [0.0; 3], [1e-3, -1e-3]), None, "{k:?}");
        }
    }
}
