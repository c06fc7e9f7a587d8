//! The similarity that leads from predicted cameras to known ones.
//!
//! Scale and shift come from the centres, the rotation from centres and orientations together: centres in a line leave a turn about that
//! line free, and orientations do not. Centres are divided by their spread first, so that both count alike. One wrong camera must not
//! move the result: a start is chosen among those of all pairs of cameras, and cameras far off then lose their weight (Tukey).

use glam::{DMat3, DVec3};
use gs_base::median;

/// Most cameras whose pairs are tried as a start: 40 have 780 pairs.
const STARTS_MAX: usize = 40;

/// Rounds of weights and fits; they settle in about five.
const ROUNDS: usize = 15;

/// Tukey's constant: 95 % of the efficiency of least squares on Gaussian errors.
const TUKEY: f64 = 4.685;

/// From the median of absolute values to a standard deviation.
const MAD: f64 = 1.4826;

/// Residuals below this share of the spread are never outliers: predicted cameras of VGGT are 1 to 3 % off.
const RESIDUAL_FLOOR: f64 = 0.01;

/// Spread of centres, relative to their distance from the world's origin, below which they are one point to double precision.
const SPREAD_MIN: f64 = 1e-9;

/// Predicted and known centres whose normalised correlation is below this have no scale in common.
const CORRELATION_MIN: f64 = 0.3;

/// Determinant of a matrix of size 1 below which it leaves a turn free to double precision.
const DETERMINANT_MIN: f64 = 1e-9;

/// A camera's rotation to world and its centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placed {
    pub rotation: DMat3,
    pub centre: DVec3,
}

/// `known = scale * rotation * predicted + shift`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Similarity {
    pub scale: f64,
    pub rotation: DMat3,
    pub shift: DVec3,
}

/// How far a predicted camera is from the known one after the similarity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraResidual {
    /// Distance of the centres as a share of the known centres' root mean square distance from their mean.
    pub centre: f64,
    /// Angle between the orientations, degrees.
    pub angle: f64,
}

impl Similarity {
    fn residual(&self, predicted: &Placed, known: &Placed, spread: f64) -> CameraResidual {
        let centre = self.scale * (self.rotation * predicted.centre) + self.shift;
        let off = known.rotation.transpose() * self.rotation * predicted.rotation;
        // From the chord, which keeps small angles that the trace loses.
        let chord = (off - DMat3::IDENTITY).to_cols_array().iter().map(|value| value * value).sum::<f64>().sqrt();
        let angle = 2.0 * (chord / 8.0_f64.sqrt()).min(1.0).asin();
        CameraResidual { centre: centre.distance(known.centre) / spread, angle: angle.to_degrees() }
    }
}

impl CameraResidual {
    /// Centre and orientation in one number: a radian counts as one spread.
    fn combined(&self) -> f64 {
        self.centre.hypot(self.angle.to_radians())
    }
}

/// Fits the similarity; with the residual of each camera. `None` when there are fewer than two cameras, when known or predicted centres
/// coincide, or when they have no scale in common.
pub(super) fn fit(predicted: &[Placed], known: &[Placed]) -> Option<(Similarity, Vec<CameraResidual>)> {
    let count = predicted.len();
    let mut weights = vec![1.0; count];
    let (_, spread) = mean_and_spread(known, &weights);
    let farthest = known.iter().map(|camera| camera.centre.length()).fold(0.0, f64::max);
    if count < 2 || spread <= SPREAD_MIN * farthest {
        return None;
    }
    let residuals = |similarity: &Similarity| -> Vec<CameraResidual> {
        predicted.iter().zip(known).map(|(a, b)| similarity.residual(a, b, spread)).collect()
    };
    // The sum of absolute residuals, which one wrong camera of four cannot turn.
    let cost = |similarity: &Similarity| residuals(similarity).iter().map(CameraResidual::combined).sum::<f64>();
    let starts = starts(count).filter_map(|(a, b)| weighted(predicted, known, &pair(count, a, b)));
    let mut best = starts.min_by(|a, b| cost(a).total_cmp(&cost(b)))?;
    for _ in 0..ROUNDS {
        let off: Vec<f64> = residuals(&best).iter().map(CameraResidual::combined).collect();
        let scale = TUKEY * (MAD * median(off.clone())?).max(RESIDUAL_FLOOR);
        weights = off.iter().map(|off| (1.0 - (off / scale).powi(2)).max(0.0).powi(2)).collect();
        best = weighted(predicted, known, &weights).unwrap_or(best);
    }
    let residuals = residuals(&best);
    Some((best, residuals))
}

/// Pairs of at most [`STARTS_MAX`] cameras that are spread over the list.
fn starts(count: usize) -> impl Iterator<Item = (usize, usize)> {
    let tried = count.min(STARTS_MAX);
    let at = move |index: usize| index * count / tried;
    (0..tried).flat_map(move |a| (a + 1..tried).map(move |b| (at(a), at(b))))
}

fn pair(count: usize, a: usize, b: usize) -> Vec<f64> {
    (0..count).map(|index| if index == a || index == b { 1.0 } else { 0.0 }).collect()
}

/// The least squares similarity. The known centres are exact, so the scale comes from the predicted ones regressed on them: its inverse
/// is free of bias by errors of the predicted.
fn weighted(predicted: &[Placed], known: &[Placed], weights: &[f64]) -> Option<Similarity> {
    let (from_mean, from_spread) = mean_and_spread(predicted, weights);
    let (to_mean, to_spread) = mean_and_spread(known, weights);
    if !(from_spread > 0.0 && to_spread > 0.0) {
        return None;
    }
    let mut sum = DMat3::ZERO;
    for ((a, b), weight) in predicted.iter().zip(known).zip(weights) {
        let (from, to) = ((a.centre - from_mean) / from_spread, (b.centre - to_mean) / to_spread);
        let outer = DMat3::from_cols(to * from.x, to * from.y, to * from.z);
        sum += (outer + b.rotation * a.rotation.transpose()) * *weight;
    }
    let rotation = nearest_rotation(sum)?;
    let (mut along, mut length) = (0.0, 0.0);
    for ((a, b), weight) in predicted.iter().zip(known).zip(weights) {
        let to = b.centre - to_mean;
        along += weight * to.dot(rotation * (a.centre - from_mean));
        length += weight * to.length_squared();
    }
    let total: f64 = weights.iter().sum();
    let scale = length / along;
    let correlation = along / (total * from_spread * to_spread);
    if !(scale.is_finite() && correlation > CORRELATION_MIN) {
        return None;
    }
    Some(Similarity { scale, rotation, shift: to_mean - scale * (rotation * from_mean) })
}

/// The weighted mean of centres and their root mean square distance from it.
fn mean_and_spread(cameras: &[Placed], weights: &[f64]) -> (DVec3, f64) {
    let total: f64 = weights.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let mean = cameras.iter().zip(weights).map(|(camera, weight)| camera.centre * *weight).sum::<DVec3>() / total;
    let square = cameras.iter().zip(weights).map(|(camera, weight)| weight * camera.centre.distance_squared(mean));
    (mean, (square.sum::<f64>() / total).sqrt())
}

/// The rotation nearest to a matrix, by Newton's iteration `M <- (M + M^-T) / 2` with the matrix scaled first; `None` for a reflection
/// or a matrix without inverse.
fn nearest_rotation(matrix: DMat3) -> Option<DMat3> {
    let determinant = matrix.determinant();
    let size = matrix.to_cols_array().iter().map(|value| value * value).sum::<f64>().sqrt();
    if determinant.is_nan() || determinant <= DETERMINANT_MIN * size.powi(3) {
        return None;
    }
    let mut rotation = matrix * determinant.cbrt().recip();
    // A step halves large singular values, and turns small ones into large ones; 30 halvings lead from 1e9 to 1.
    for _ in 0..60 {
        rotation = (rotation + rotation.inverse().transpose()) * 0.5;
    }
    Some(rotation)
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    fn camera(centre: DVec3, turn: f64) -> Placed {
        let axis = DVec3::new(0.2, 1.0, -0.3).normalize();
        Placed { rotation: DMat3::from_quat(DQuat::from_axis_angle(axis, turn)), centre }
    }

    /// Known cameras in the reconstructor's world under a similarity.
    fn hidden(known: &[Placed], truth: &Similarity) -> Vec<Placed> {
        let back = truth.rotation.transpose();
        known
            .iter()
            .map(|camera| Placed {
                rotation: back * camera.rotation,
                centre: back * (camera.centre - truth.shift) / truth.scale,
            })
            .collect()
    }

    fn truth() -> Similarity {
        let rotation = DMat3::from_quat(DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -1.0).normalize(), 2.3));
        Similarity { scale: 3.7, rotation, shift: DVec3::new(4.0, -1.0, 0.5) }
    }

    fn close(found: &Similarity, tolerance: f64) {
        let truth = truth();
        let turn = (found.rotation - truth.rotation).to_cols_array().iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        assert!((found.scale / truth.scale - 1.0).abs() < tolerance && turn < tolerance, "{found:?}");
        assert!(found.shift.distance(truth.shift) < 10.0 * tolerance, "{found:?}");
    }

    #[test]
    fn two_cameras_and_cameras_in_a_line_are_fixed_by_their_orientations() {
        for count in [2, 5] {
            let known: Vec<Placed> = (0..count).map(|i| camera(DVec3::X * i as f64, 0.3 * i as f64)).collect();
            let (found, residuals) = fit(&hidden(&known, &truth()), &known).expect("a similarity");
            close(&found, 1e-9);
            assert!(residuals.iter().all(|residual| residual.centre < 1e-9 && residual.angle < 1e-6));
        }
    }

    #[test]
    fn one_wrong_camera_moves_nothing_and_is_named() {
        let place = |i: usize| DVec3::new((i as f64 * 1.3).cos() * 2.0, (i as f64 * 1.3).sin() * 2.0, 0.4 * i as f64);
        let known: Vec<Placed> = (0..6).map(|i| camera(place(i), 0.4 * i as f64)).collect();
        let mut predicted = hidden(&known, &truth());
        predicted[3] = camera(DVec3::new(30.0, -20.0, 10.0), 2.0);
        let (found, residuals) = fit(&predicted, &known).expect("a similarity");
        close(&found, 1e-9);
        assert!(residuals[3].centre > 1.0 && residuals[2].centre < 1e-9, "{residuals:?}");
    }

    #[test]
    fn centres_in_one_point_have_no_scale() {
        let known = [camera(DVec3::ONE, 0.0), camera(DVec3::ONE, 1.0)];
        assert!(fit(&known, &known).is_none());
        assert!(fit(&known[..1], &known[..1]).is_none());
        let apart = [camera(DVec3::ZERO, 0.0), camera(DVec3::X, 1.0)];
        assert!(fit(&known, &apart).is_none(), "predicted centres coincide");
    }
}
