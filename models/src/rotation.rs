//! Turning Gaussians: rotation vector to quaternion, and the quaternion product, on rows.
//!
//! `q(t) = exp(r(t) / 2) q_0` with `exp(r / 2) = (cos(a / 2), sin(a / 2) / a r)`, `a = |r|`: a turn by `a` radians
//! about the world axis `r / a`, applied after the Gaussian's own orientation `q_0`. TaylorMoDe-GS moves positions
//! only; its base (Infinite Taylor Gaussian) gives rotation a Taylor series too, and so do we, but of the rotation
//! vector, which stays a rotation whatever its coefficients.

use burn::tensor::{Tensor, TensorData};
use gs_burn::exact_matmul;
use gs_burn::glam::{DQuat, DVec3};

/// `a` is measured as `sqrt(|r|^2 + ANGLE_FLOOR^2)`, which has a derivative at 0 where `|r|` has none. The square is
/// the smallest at which `f32` still has a normal number and the identity stays the identity in `f64`: `cos` is then
/// off by 1e-17. The result differs from the exact one by less than `ANGLE_FLOOR` times the angle.
const ANGLE_FLOOR: f64 = 1e-8;

/// Positions and signs of products of quaternion entries: entry `4 i + j` of the outer product of `a` and `b` (w x y z)
/// has this sign in this entry of `a b` (Hamilton).
const PRODUCT: [[(usize, f64); 4]; 4] = [
    [(0, 1.0), (1, 1.0), (2, 1.0), (3, 1.0)],
    [(1, 1.0), (0, -1.0), (3, 1.0), (2, -1.0)],
    [(2, 1.0), (3, -1.0), (0, -1.0), (1, 1.0)],
    [(3, 1.0), (2, 1.0), (1, -1.0), (0, -1.0)],
];

/// The rotation vector of `rotation`, radians, at most half a circle long. A quaternion and its negative are one
/// rotation; by the entries alone one of them turns by more than half a circle.
pub fn shortest(rotation: DQuat) -> DVec3 {
    if rotation.w < 0.0 { (-rotation).to_scaled_axis() } else { rotation.to_scaled_axis() }
}

/// The rotation vector of `rotation` nearest to `expected`, radians: turns beyond half a circle go on.
pub fn nearest(rotation: DQuat, expected: DVec3) -> DVec3 {
    let own = shortest(rotation);
    let axis = own.try_normalize().or_else(|| expected.try_normalize()).unwrap_or(DVec3::Z);
    let turns = ((expected - own).dot(axis) / std::f64::consts::TAU).round();
    own + turns * std::f64::consts::TAU * axis
}

/// `exp(r / 2) - 1` of rotation vectors `r` `[M, 3]` (radians, world axes), as quaternions w x y z `[M, 4]`.
///
/// Smooth everywhere, zero included. The identity is subtracted, because near it the small difference carries the
/// digits.
pub fn exp_less_one(rotation: Tensor<2>) -> Tensor<2> {
    let squared = rotation.clone().square().sum_dim(1);
    let angle = (squared + ANGLE_FLOOR * ANGLE_FLOOR).sqrt();
    let imaginary = rotation * ((angle.clone() * 0.5).sin() / angle.clone());
    // cos(a / 2) - 1 without the cancellation.
    let real = (angle * 0.25).sin().square() * -2.0;
    Tensor::cat(vec![real, imaginary], 1)
}

/// Quaternion products `a b`, row by row, w x y z: first the turn `b`, then the turn `a`. `a` `[n M, 4]` may be `n`
/// times as long as `b` `[M, 4]`, whose rows are then gone through `n` times.
///
/// # Panics
/// When the rows of `a` are no multiple of those of `b`.
pub fn product(a: Tensor<2>, b: Tensor<2>) -> Tensor<2> {
    let ([rows, _], [own, _]) = (a.dims(), b.dims());
    assert!(rows == own || rows.is_multiple_of(own), "{rows} quaternions do not go {own} by {own}");
    let mut signs = [0.0; 64];
    for (i, row) in PRODUCT.iter().enumerate() {
        for (j, (entry, sign)) in row.iter().enumerate() {
            signs[(4 * i + j) * 4 + entry] = *sign;
        }
    }
    let signs = Tensor::<2>::from_data(TensorData::new(signs.to_vec(), [16, 4]), (&b.device(), b.dtype()));
    // One product of matrices: taking eight columns apart and putting four together costs more than the arithmetic.
    let outer = match rows == own {
        true => (a.reshape([rows, 4, 1]) * b.reshape([rows, 1, 4])).reshape([rows, 16]),
        false => (a.reshape([rows / own, own, 4, 1]) * b.reshape([1, own, 1, 4])).reshape([rows, 16]),
    };
    exact_matmul(outer, signs)
}

/// The difference that turning `quats` `[M, 4]` (any norm, kept) by `rotation` `[n M, 3]` adds to them, `[n M, 4]`; see
/// [`product`]. For a rotation of zero it is so small (1e-17 of them) that the sum is `quats` to the last bit.
pub fn turn(quats: Tensor<2>, rotation: Tensor<2>) -> Tensor<2> {
    product(exp_less_one(rotation), quats)
}
