//! The path of a pixel's surface through the image during the exposure: Eq. 6 and 8 to 10.
//!
//! `P_cam = D_in K^-1 (u, 1)`, `v_cam = R_view V_final`, `u_i = project(P_cam + t_i v_cam)`. Written out for a pinhole
//! with focal length `f` and principal point `c`, with `v_cam = (v_xy, v_z)`: `u_i = u + t_i (f v_xy - (u - c) v_z) /
//! (D_in + t_i v_z)`. In this form a pixel that does not move stays exactly where it is, and the point itself is never
//! needed.

use burn::tensor::{Tensor, TensorData};
use gs_base::Intrinsics;
use gs_burn::ops::products::scaled;
use gs_burn::{exact_matmul, profile};

use crate::pixels::Pixels;

/// Points are kept at least this far before the camera, scene units: the renderer's default near plane. A pixel whose
/// depth is less shows nothing, and is taken not to move.
pub const NEAREST: f64 = 0.01;

/// The depth for back-projection, Eq. 6: `beta prior + (1 - beta) rendered`, any one shape, camera z in scene units.
///
/// It is the rendered depth where the prior is unknown (0), and the prior where nothing is rendered. `beta` is 0.3 in
/// the paper. Differentiable with respect to `rendered`.
pub fn hybrid_depth<const D: usize>(rendered: Tensor<D>, prior: Tensor<D>, beta: f64) -> Tensor<D> {
    let known = prior.clone().greater_scalar(0.0);
    let missing = rendered.clone().lower_scalar(NEAREST);
    let share = known.clone().float().cast(prior.dtype()) * beta;
    let share = share.mask_fill(known.bool_and(missing), 1.0);
    rendered.clone() + (prior - rendered) * share
}

/// World velocities `[P, 3]` in camera axes, Eq. 9; `viewmat` is world to camera, `[4, 4]`.
pub fn camera_velocity(velocity: Tensor<2>, viewmat: &Tensor<2>) -> Tensor<2> {
    let rotation = rotation(viewmat, &velocity);
    exact_matmul(velocity, rotation.transpose())
}

/// The points seen at `pixels` at `depth` `[P, 1]` (camera z), Eq. 8, `[P, 3]`, camera axes.
pub fn back_project(pixels: &Pixels, depth: Tensor<2>, intrinsics: &Intrinsics) -> Tensor<2> {
    let (offset, [fx, fy]) = from_centre(pixels, &depth, intrinsics);
    let scale = Tensor::from_data(TensorData::new(vec![1.0 / fx, 1.0 / fy], [1, 2]), (&depth.device(), depth.dtype()));
    Tensor::cat(vec![offset * scale * depth.clone(), depth], 1)
}

/// Points in camera axes to the world, `[P, 3]`.
pub fn to_world(points: Tensor<2>, viewmat: &Tensor<2>) -> Tensor<2> {
    let translation = viewmat.clone().cast(points.dtype()).narrow(0, 0, 3).narrow(1, 3, 1).transpose();
    // The inverse of a rotation from the left is, on rows, the rotation itself from the right.
    exact_matmul(points.clone() - translation, rotation(viewmat, &points))
}

/// Image positions of each pixel's surface at each moment of the exposure, Eq. 10: `[N, P, 2]`, pixels.
///
/// `depth` `[P, 1]` is camera z (Eq. 6), `velocity` `[P, 3]` is in camera axes, scene units per unit of time (Eq. 9),
/// `offsets` `[N]` are the moments, in the unit of time, from the exposure's centre (Eq. 7). Differentiable by all
/// three.
pub fn blur_path(
    pixels: &Pixels,
    depth: Tensor<2>,
    velocity: Tensor<2>,
    intrinsics: &Intrinsics,
    offsets: Tensor<1>,
) -> Tensor<3> {
    let _stage = profile::stage("blur path");
    let count = pixels.len();
    let options = (&depth.device(), depth.dtype());
    let (offset, [fx, fy]) = from_centre(pixels, &depth, intrinsics);
    let known = depth.clone().greater_equal_scalar(NEAREST).float().cast(depth.dtype());
    let velocity = velocity * known;
    let lateral = Tensor::<2>::from_data(TensorData::new(vec![fx, 0.0, 0.0, fy, 0.0, 0.0], [3, 2]), options);
    let forward = Tensor::<2>::from_data(TensorData::new(vec![0.0, 0.0, 1.0], [3, 1]), options);
    let approach = exact_matmul(velocity.clone(), forward);
    let flow = exact_matmul(velocity, lateral) - offset * approach.clone();

    let offsets = offsets.cast(depth.dtype());
    let depth = depth.reshape([1, count, 1]) + scaled(offsets.clone(), approach);
    let path = scaled(offsets, flow) / depth.clamp_min(NEAREST);
    path + pixels.centres.clone().cast(options.1).reshape([1, count, 2])
}

/// Pixels from the principal point, `[P, 2]`, and the focal lengths.
fn from_centre(pixels: &Pixels, like: &Tensor<2>, intrinsics: &Intrinsics) -> (Tensor<2>, [f64; 2]) {
    let Intrinsics { fx, fy, cx, cy } = *intrinsics;
    let centre = Tensor::from_data(TensorData::new(vec![cx, cy], [1, 2]), (&like.device(), like.dtype()));
    (pixels.centres.clone().cast(like.dtype()) - centre, [fx, fy])
}

/// The rotation of `viewmat`, `[3, 3]`.
fn rotation(viewmat: &Tensor<2>, like: &Tensor<2>) -> Tensor<2> {
    viewmat.clone().cast(like.dtype()).narrow(0, 0, 3).narrow(1, 0, 3)
}
