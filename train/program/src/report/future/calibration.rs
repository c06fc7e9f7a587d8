//! Whether the predicted spread is right: Gaussians by their spread, each group with its true error.
//!
//! Where the data set has the true motion of its bodies, the error is the distance of a Gaussian from where its body
//! carries it. Elsewhere the spread that a pixel shows is held against the error of the rendered image, which has
//! another unit: then only the order can be judged.

use gs_base::median;
use gs_datasets::Mover;
use gs_datasets::View;
use gs_models::DynamicScene;
use serde::Serialize;

use super::motion::seen;
use super::renderer::{PredictedScene, pose_of};
use super::spread::Spread;
use crate::report::charts::{Chart, Series};
use gs_train::fit::parameters::{from_host, to_host};
use gs_train::fit::photos::colors_of;
use gs_train::fit::times::through_time;

/// Groups of equal size in which spread and error are compared.
const GROUPS: usize = 10;

/// Views at which the image error is measured at most.
const VIEWS: usize = 12;

/// Opacity of a pixel below which it shows the background, whose error no spread explains.
const SEEN: f32 = 0.5;

/// Least spread and error in the chart, scene units: logarithms of zero are none.
const LEAST: f64 = 1e-6;

/// A Gaussian farther from a body's position than its radius times this is not of the body: radii are bounds of the
/// true shape, learned Gaussians lie around its surface.
const AROUND: f64 = 1.1;

/// The number against which the spread is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Against {
    /// The distance from the true motion since the first frame, scene units.
    TrueMotion,
    /// The absolute difference of rendering and photo, 0 to 1.
    ImageError,
}

/// A group of pairs of alike spread.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Group {
    /// Pairs.
    pub count: usize,
    /// Root mean square spread, scene units.
    pub spread: f64,
    /// Root mean square error.
    pub error: f64,
}

/// Spread against error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Calibration {
    /// The error that was measured.
    pub against: Against,
    /// From the smallest spread to the largest.
    pub groups: Vec<Group>,
    /// Root mean square error over root mean square spread of all pairs; 1 is ideal, above 1 the spread is too small.
    /// `None` against an image.
    pub error_over_spread: Option<f64>,
    /// Median of each Gaussian's error over its spread: a few that are far off do not count. `None` against an image.
    pub median_error_over_spread: Option<f64>,
}

impl Calibration {
    /// Groups pairs of spread and error; `None` without pairs.
    pub fn of(against: Against, mut pairs: Vec<(f64, f64)>) -> Option<Self> {
        pairs.retain(|(spread, error)| spread.is_finite() && error.is_finite());
        if pairs.is_empty() {
            return None;
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let groups: Vec<Group> = pairs.chunks(pairs.len().div_ceil(GROUPS)).map(group).collect();
        let all = group(&pairs);
        let one_unit = against == Against::TrueMotion && all.spread > 0.0;
        let ratios = pairs.iter().filter(|(spread, _)| *spread > 0.0).map(|(spread, error)| error / spread);
        Some(Self {
            against,
            groups,
            error_over_spread: one_unit.then_some(all.error / all.spread),
            median_error_over_spread: median(ratios.collect()).filter(|_| one_unit),
        })
    }

    /// The groups as a chart, with the line on which they should lie where both have one unit. Both axes are
    /// logarithms: spreads of what follows a law and of what does not differ by powers of ten.
    pub fn chart(&self) -> Chart {
        let logarithm = |value: f64| value.max(LEAST).log10();
        let point = |group: &Group| match self.against {
            Against::TrueMotion => (logarithm(group.spread), logarithm(group.error)),
            Against::ImageError => (logarithm(group.spread), group.error),
        };
        let points: Vec<(f64, f64)> = self.groups.iter().map(point).collect();
        let ends = points.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], (x, _)| [a.min(*x), b.max(*x)]);
        let (of, y) = match self.against {
            Against::TrueMotion => ("groups of Gaussians", "log10 of true error, units"),
            Against::ImageError => ("groups of pixels", "image error, 0 to 1"),
        };
        let mut series = vec![Series::line_and_dots(of, points)];
        if self.against == Against::TrueMotion {
            series.push(Series::line("ideal", ends.map(|end| (end, end)).to_vec()));
        }
        let x = "log10 of the ensemble's spread, scene units";
        Chart { title: "Predicted spread and error".into(), x: x.into(), y: y.into(), series }
    }
}

fn group(pairs: &[(f64, f64)]) -> Group {
    let rms = |value: fn(&(f64, f64)) -> f64| {
        (pairs.iter().map(|pair| value(pair).powi(2)).sum::<f64>() / pairs.len().max(1) as f64).sqrt()
    };
    Group { count: pairs.len(), spread: rms(|pair| pair.0), error: rms(|pair| pair.1) }
}

/// Spread and error of the Gaussians of `rows` at the times of `spread`, by the true motion of bodies in the world of
/// the scene. Gaussians of no true body should rest.
pub fn by_true_motion(scene: &dyn DynamicScene, spread: &Spread, rows: &[u32], movers: &[Mover]) -> Vec<(f64, f64)> {
    let Some([start, _]) = scene.span() else { return Vec::new() };
    let at = |values: &[f32], row: u32| {
        let from = 3 * row as usize;
        glam::DVec3::new(values[from].into(), values[from + 1].into(), values[from + 2].into())
    };
    let first = to_host(scene.at(start).means.val());
    let of_body: Vec<Option<&Mover>> = rows.iter().map(|row| carrier(movers, at(&first, *row), start)).collect();
    let mut pairs = Vec::new();
    for ((time, values), now) in spread.times.iter().zip(&spread.values).zip(through_time(scene, &spread.times)) {
        let now = to_host(now.means.val());
        for (row, mover) in rows.iter().zip(&of_body) {
            let begin = at(&first, *row);
            let Some(truth) = mover.map_or(Some(begin), |mover| mover.carried(begin, start, *time)) else { continue };
            pairs.push((values[*row as usize].into(), at(&now, *row).distance(truth)));
        }
    }
    pairs
}

/// The body that a point belongs to: the nearest of those that reach it.
fn carrier(movers: &[Mover], point: glam::DVec3, time: f64) -> Option<&Mover> {
    let reach = |mover: &&Mover| {
        let distance = mover.position(time)?.distance(point) / mover.radius;
        (distance <= AROUND).then_some(distance)
    };
    let near = movers.iter().filter_map(|mover| Some((reach(&mover)?, mover)));
    near.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, mover)| mover)
}

/// Spread and image error of the pixels of a few of `views`, whose times are those of `spread`.
pub fn by_images(predicted: &PredictedScene, spread: &Spread, views: &[&View]) -> Vec<(f64, f64)> {
    let device = &predicted.renderer.device;
    let mut pairs = Vec::new();
    let position = |view: &&View| spread.times.iter().position(|time| view.time == Some(*time));
    let views = views.iter().step_by(views.len().div_ceil(VIEWS).max(1));
    let views: Vec<(&View, usize)> = views.filter_map(|view| Some((*view, position(view)?))).collect();
    let times: Vec<f64> = views.iter().map(|(_, index)| spread.times[*index]).collect();
    for ((view, index), gaussians) in views.into_iter().zip(through_time(predicted.scene, &times)) {
        let pose = pose_of(view);
        let features = from_host(spread.values[index].clone(), 1, device);
        let (spreads, alpha) = seen(predicted.renderer, &gaussians, &pose, features);
        let image = predicted.renderer.image(&gaussians, &pose);
        let error = to_host((image - colors_of(view, device)).abs().mean_dim(2));
        let pixels = spreads.iter().zip(&error).zip(&alpha).filter(|(_, alpha)| **alpha >= SEEN);
        pairs.extend(pixels.map(|((spread, error), _)| (f64::from(*spread), f64::from(*error))));
    }
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Errors that are normal with the predicted spread lie on the ideal line.
    #[test]
    fn a_right_spread_has_a_ratio_of_one() {
        let pairs: Vec<(f64, f64)> = (0..4000)
            .map(|k| {
                let spread = 0.1 + f64::from(k % 40) / 40.0;
                // Half of the errors are 0, half the square root of two spreads: the root mean square is the spread.
                (spread, if (k / 40) % 2 == 0 { 0.0 } else { 2.0_f64.sqrt() * spread })
            })
            .collect();
        let found = Calibration::of(Against::TrueMotion, pairs).expect("pairs");
        assert!((found.error_over_spread.expect("a ratio") - 1.0).abs() < 1e-9);
        assert_eq!(found.groups.len(), GROUPS);
        assert!(found.groups.windows(2).all(|pair| pair[0].spread <= pair[1].spread));
        assert!(found.chart().svg().contains("ideal"));
        assert!(Calibration::of(Against::TrueMotion, vec![(f64::NAN, 1.0)]).is_none());
    }
}
