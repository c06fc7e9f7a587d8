//! Three-vectors, rotations and quaternions, with the vector-Jacobian products of the backward passes; for one number
//! or for sixteen at once ([`crate::cpu::wide::Wide`]). Nothing here is a closure, because a closure that is not
//! inlined is compiled without the processor's vector instructions.

use crate::cpu::real::Number;

/// A vector in three dimensions.
pub type Vec3<F> = [F; 3];
/// Three rows of three.
pub type Mat3<F> = [[F; 3]; 3];

/// Scalar product.
#[inline(always)]
pub fn dot<F: Number>(a: Vec3<F>, b: Vec3<F>) -> F {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Vector product.
#[inline(always)]
pub fn cross<F: Number>(a: Vec3<F>, b: Vec3<F>) -> Vec3<F> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `x a + y b`.
#[inline(always)]
pub fn combine<F: Number>(x: F, a: Vec3<F>, y: F, b: Vec3<F>) -> Vec3<F> {
    [x * a[0] + y * b[0], x * a[1] + y * b[1], x * a[2] + y * b[2]]
}

/// `m v`.
#[inline(always)]
pub fn mat_vec<F: Number>(m: &Mat3<F>, v: Vec3<F>) -> Vec3<F> {
    [dot(m[0], v), dot(m[1], v), dot(m[2], v)]
}

/// `m^T v`.
#[inline(always)]
pub fn mat_t_vec<F: Number>(m: &Mat3<F>, v: Vec3<F>) -> Vec3<F> {
    [
        m[0][0] * v[0] + m[1][0] * v[1] + m[2][0] * v[2],
        m[0][1] * v[0] + m[1][1] * v[1] + m[2][1] * v[2],
        m[0][2] * v[0] + m[1][2] * v[1] + m[2][2] * v[2],
    ]
}

/// Rotation matrix of a unit quaternion `[w, x, y, z]`.
#[inline(always)]
pub fn rotation<F: Number>([w, x, y, z]: [F; 4]) -> Mat3<F> {
    let (one, two) = (F::of(1.0), F::of(2.0));
    [
        [one - two * (y * y + z * z), two * (x * y - w * z), two * (x * z + w * y)],
        [two * (x * y + w * z), one - two * (x * x + z * z), two * (y * z - w * x)],
        [two * (x * z - w * y), two * (y * z + w * x), one - two * (x * x + y * y)],
    ]
}

/// Gradient by the unit quaternion from the gradient `v` by its rotation matrix.
#[inline(always)]
pub fn rotation_vjp<F: Number>([w, x, y, z]: [F; 4], v: &Mat3<F>) -> [F; 4] {
    let two = F::of(2.0);
    let (skew_x, skew_y, skew_z) = (v[2][1] - v[1][2], v[0][2] - v[2][0], v[1][0] - v[0][1]);
    let (sym_xy, sym_xz, sym_yz) = (v[0][1] + v[1][0], v[0][2] + v[2][0], v[1][2] + v[2][1]);
    [
        two * (x * skew_x + y * skew_y + z * skew_z),
        two * (w * skew_x + y * sym_xy + z * sym_xz - two * x * (v[1][1] + v[2][2])),
        two * (w * skew_y + x * sym_xy + z * sym_yz - two * y * (v[0][0] + v[2][2])),
        two * (w * skew_z + x * sym_xz + y * sym_yz - two * z * (v[0][0] + v[1][1])),
    ]
}

/// Gradient by `q` from the gradient `v` by `unit = q / |q|`.
#[inline(always)]
pub fn normalise_vjp<F: Number>(unit: [F; 4], norm: F, v: [F; 4]) -> [F; 4] {
    let along = unit[0] * v[0] + unit[1] * v[1] + unit[2] * v[2] + unit[3] * v[3];
    [
        (v[0] - unit[0] * along) / norm,
        (v[1] - unit[1] * along) / norm,
        (v[2] - unit[2] * along) / norm,
        (v[3] - unit[3] * along) / norm,
    ]
}

/// Product by components.
#[inline(always)]
pub fn scaled<F: Number>(a: Vec3<F>, b: Vec3<F>) -> Vec3<F> {
    [a[0] * b[0], a[1] * b[1], a[2] * b[2]]
}

/// Row `index` of a packed list of `K`-vectors.
#[inline(always)]
pub fn row<F: Copy, const K: usize>(values: &[F], index: usize) -> [F; K] {
    values[index * K..][..K].try_into().expect("a slice of K values")
}
