//! How many Gaussians and colours do few cameras determine? More of either fit the photos that are seen and not those
//! that are held out.

use anyhow::Result;
use gs_worlds::extrapolation::{ExtrapolationOptions, World};

use super::trial::{Film, SEEN, means, scores, small, trial};
use crate::experiments::{Findings, Lab, Series, largest, smallest};

/// Training cameras.
const COUNTS: [usize; 5] = [2, 3, 5, 9, 15];
const COUNTS_QUICK: [usize; 2] = [2, 5];

/// Most Gaussians of a run.
const CAPS: [usize; 3] = [300, 1000, 3000];

/// Degrees of the colours, with the middle cap.
const DEGREES: [usize; 3] = [0, 1, 2];

/// Most that the largest cap may lose against the best one, dB: twice the 0.3 dB that seeds may spread by.
const CAP_BOUND: f64 = 0.6;

/// Most that colours of degree 0 may lose against richer ones where there are five cameras or fewer, dB: what is asked
/// of seeds.
const DEGREE_BOUND: f64 = 0.3;

/// Cameras up to which colours of degree 0 must do.
const FEW: usize = 5;

/// Least gain of 15 cameras over 2, dB: with seven times the cameras anything less would mean that cameras are not what
/// is missing.
const CAMERAS_BOUND: f64 = 3.0;

/// A run.
struct Point {
    cameras: usize,
    cap: usize,
    degree: usize,
    gaussians: usize,
    /// PSNR over the images of held-out cameras, dB.
    test: f64,
    /// The same over photos that were trained on.
    train: f64,
}

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let film = Film::of(lab, &ExtrapolationOptions { cameras: 18, held_out: 3, ..small(World::Slider) })?;
    let counts: &[usize] = lab.either(&COUNTS, &COUNTS_QUICK);
    let caps: &[usize] = lab.either(&CAPS, &CAPS[1..2]);
    let degrees: &[usize] = lab.either(&DEGREES, &[0, 2]);
    let mut points = Vec::new();
    for cameras in counts {
        for cap in caps {
            points.push(point(lab, &film, (*cameras, *cap, 0))?);
        }
        for degree in degrees.iter().filter(|degree| **degree > 0) {
            points.push(point(lab, &film, (*cameras, CAPS[1], *degree))?);
        }
    }
    judge(found, &points);
    charts(found, &points, counts);
    found.notes.extend(counts.iter().map(|cameras| gap(&points, *cameras)));
    Ok(())
}

fn point(lab: &Lab, film: &Film, (cameras, cap, degree): (usize, usize, usize)) -> Result<Point> {
    let (cap_text, degree_text) = (format!("density.cap={cap}"), format!("model.sh_degree={degree}"));
    let scene = film.seen(cameras, SEEN);
    let seen = scene.train.clone();
    let trial = trial(lab, scene, &[&cap_text, &degree_text])?;
    let session = trial.trained(lab)?;
    // Not in the future, which would add the error of the motion.
    let test = means(&scores(lab, &session, &film.future(-1.0, SEEN)))[0];
    let train = means(&scores(lab, &session, &seen))[0];
    Ok(Point { cameras, cap, degree, gaussians: session.fit.trainer.gaussians().len(), test, train })
}

fn test_of(points: &[Point], cameras: usize, cap: usize, degree: usize) -> Option<f64> {
    let is_it = |point: &&Point| (point.cameras, point.cap, point.degree) == (cameras, cap, degree);
    points.iter().find(is_it).map(|point| point.test)
}

fn judge(found: &mut Findings, points: &[Point]) {
    let counts = || points.iter().map(|point| point.cameras);
    let lost_by_cap = COUNTS.iter().filter_map(|cameras| {
        let best = largest(CAPS.iter().filter_map(|cap| test_of(points, *cameras, *cap, 0)))?;
        Some(best - test_of(points, *cameras, CAPS[2], 0)?)
    });
    let lost_by_cap: Vec<f64> = lost_by_cap.collect();
    if !lost_by_cap.is_empty() {
        let what = "most Gaussians: PSNR of held-out cameras below that of the best cap, worst count of cameras";
        found.at_most(what, largest(lost_by_cap), CAP_BOUND, "dB");
    }
    let lost_by_degree = COUNTS.iter().filter(|cameras| **cameras <= FEW).filter_map(|cameras| {
        let rich = largest([1, 2].iter().filter_map(|degree| test_of(points, *cameras, CAPS[1], *degree)))?;
        Some(rich - test_of(points, *cameras, CAPS[1], 0)?)
    });
    let what = "colours of degree 0: PSNR of held-out cameras below that of degree 1 or 2, 5 cameras or fewer";
    found.at_most(what, largest(lost_by_degree), DEGREE_BOUND, "dB");
    if let (Some(few), Some(many)) = (counts().min(), counts().max()) {
        let gain =
            test_of(points, many, CAPS[1], 0).zip(test_of(points, few, CAPS[1], 0)).map(|(many, few)| many - few);
        let what = format!("PSNR of held-out cameras, {many} training cameras above {few}");
        found.at_least(what, gain, CAMERAS_BOUND, "dB");
    }
}

/// Train and test of one count of cameras in a sentence.
fn gap(points: &[Point], cameras: usize) -> String {
    let has_cameras = |point: &&Point| point.cameras == cameras;
    let each = points.iter().filter(has_cameras).map(|point| {
        let Point { gaussians, degree, test, train, .. } = point;
        format!("{gaussians} Gaussians of degree {degree} {train:.2} and {test:.2}")
    });
    let lowest = smallest(points.iter().filter(has_cameras).map(|point| point.train - point.test)).unwrap_or(f64::NAN);
    let all = each.collect::<Vec<_>>().join("; ");
    format!("{cameras} cameras, PSNR of seen and held-out photos, dB: {all}. The smallest gap is {lowest:.2} dB.")
}

fn charts(found: &mut Findings, points: &[Point], counts: &[usize]) {
    let curve = |cameras: usize, keep: &dyn Fn(&Point) -> bool, x: &dyn Fn(&Point) -> f64| {
        let kept = points.iter().filter(|point| point.cameras == cameras && keep(point));
        Series::line_and_dots(&format!("{cameras} cameras"), kept.map(|point| (x(point), point.test)).collect())
    };
    let by = |keep: &dyn Fn(&Point) -> bool, x: &dyn Fn(&Point) -> f64| -> Vec<Series> {
        counts.iter().map(|cameras| curve(*cameras, keep, x)).collect()
    };
    let y = "PSNR of held-out cameras, dB";
    let title = "Held-out cameras by number of Gaussians, colours of degree 0";
    let count = by(&|point| point.degree == 0, &|point| (point.gaussians as f64).log10());
    found.chart("count", title, ["log10 of the number of Gaussians", y], count);
    let title = format!("Held-out cameras by degree of colours, at most {} Gaussians", CAPS[1]);
    let degree = by(&|point| point.cap == CAPS[1], &|point| point.degree as f64);
    found.chart("degree", title, ["degree of spherical harmonics", y], degree);
}
