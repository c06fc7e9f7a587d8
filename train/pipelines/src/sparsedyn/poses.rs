//! The paths of the moving Gaussians, and the poses of bodies in them.

use burn::tensor::Tensor;
use gs_burn::Gaussians;
use gs_burn::glam::DVec3;
use gs_datasets::View;
use gs_models::sparsedyn::bodies::BodyPose;
use gs_models::sparsedyn::bodies::fit::{MARKERS, Poses};
use gs_models::sparsedyn::bodies::rigid::rigid_motion;

use super::Sparsedyn;
use gs_train::fit::parameters::to_host;

/// The positions of the moving Gaussians at `times`.
pub fn paths(model: &Sparsedyn, first: &Tensor<2>, times: &[f64]) -> Vec<Vec<DVec3>> {
    model.moved(first, times).into_iter().map(|moved| vectors(to_host(moved.state.positions))).collect()
}

/// Rows of three as vectors.
pub fn vectors(values: Vec<f32>) -> Vec<DVec3> {
    values.chunks_exact(3).map(|x| DVec3::new(x[0].into(), x[1].into(), x[2].into())).collect()
}

/// The opacities of the moving Gaussians.
pub fn weights_of(model: &Sparsedyn, gaussians: &Gaussians) -> Vec<f64> {
    let opacities = to_host(gaussians.opacities());
    model.frame.rows.iter().map(|row| f64::from(opacities[*row as usize])).collect()
}

/// The poses of a body at all frames, as if they had no noise.
pub fn poses_of(paths: &[Vec<DVec3>], members: &[usize], weights: &[f64], times: &[f64]) -> Poses {
    let at = |time: &Vec<DVec3>| members.iter().map(|i| time[*i]).collect::<Vec<DVec3>>();
    let before = at(&paths[0]);
    let own: Vec<f64> = members.iter().map(|i| weights[*i]).collect();
    let first = middle(&before, &own);
    let spread = before.iter().map(|x| x.distance_squared(first)).sum::<f64>() / before.len() as f64;
    let pose = |(time, path): (&f64, &Vec<DVec3>)| (time - times[0], rigid_motion(&before, &at(path), first));
    Poses {
        first,
        size: spread.sqrt(),
        poses: times.iter().zip(paths).map(pose).collect(),
        independent: times.len() as f64,
        noise: 0.0,
    }
}

/// The Gaussians with a label, by index.
pub fn members<L: PartialEq>(labels: &[L], label: L) -> Vec<usize> {
    (0..labels.len()).filter(|i| labels[*i] == label).collect()
}

/// The one of the places `among` that is nearest to `to`; the first of equals.
pub fn nearest(places: &[DVec3], to: DVec3, among: impl Iterator<Item = usize>) -> Option<usize> {
    let far = |j: &usize| to.distance_squared(places[*j]);
    among.min_by(|a, b| far(a).total_cmp(&far(b)))
}

/// The mean of the positions by their weights.
pub fn middle(positions: &[DVec3], weights: &[f64]) -> DVec3 {
    let total: f64 = weights.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    positions.iter().zip(weights).map(|(position, weight)| *position * *weight).sum::<DVec3>() / total
}

/// Whether the markers of a body move by no more than `still`, scene units, as root mean square over them and times.
pub fn rests(poses: &Poses, still: f64) -> bool {
    let markers = MARKERS.map(|axis| poses.first + poses.size * axis);
    let moved =
        |pose: &BodyPose| markers.map(|at| pose.apply(at, poses.first).distance_squared(at)).iter().sum::<f64>();
    let sum: f64 = poses.poses.iter().map(|(_, pose)| moved(pose)).sum();
    sum <= still * still * (markers.len() * poses.poses.len()) as f64
}

/// Scene units of a pixel at `position`, in the training view that shows it largest.
pub fn pixel_size(views: &[View], position: DVec3) -> f64 {
    let sizes = views.iter().filter_map(|view| {
        let depth = view.c2w.inverse().transform_point3(position).z;
        (depth > 0.0).then(|| depth / view.intrinsics.fx)
    });
    let least = sizes.fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 1.0 }
}
