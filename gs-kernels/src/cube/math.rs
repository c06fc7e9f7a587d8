//! Three-vectors, rotations and quaternions on the device, with the vector-Jacobian products of the backward passes.

use cubecl::prelude::*;

/// A vector in three dimensions.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(crate) struct Vec3 {
    /// First component.
    pub x: f32,
    /// Second component.
    pub y: f32,
    /// Third component.
    pub z: f32,
}

/// Three rows of three.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(crate) struct Mat3 {
    /// First row.
    pub a: Vec3,
    /// Second row.
    pub b: Vec3,
    /// Third row.
    pub c: Vec3,
}

/// A quaternion.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(crate) struct Quat {
    /// Real part.
    pub w: f32,
    /// Imaginary part along x.
    pub x: f32,
    /// Imaginary part along y.
    pub y: f32,
    /// Imaginary part along z.
    pub z: f32,
}

/// Whether `value` is neither infinite nor NaN. Read off the bits, because a shader compiler may assume that NaN never
/// occurs and drop `x != x`. Compared as a whole number below the exponent of infinity: LLVM knows the test of the
/// exponent alone (`bits & 0x7f800000 != 0x7f800000`), and under fast math it makes that one `true`
/// (`tests/fast_math.rs`).
#[cube]
pub(crate) fn finite(value: f32) -> bool {
    (u32::reinterpret(value) & 0x7fff_ffffu32) < 0x7f80_0000u32
}

/// Whether all components are finite.
#[cube]
pub(crate) fn finite3(v: Vec3) -> bool {
    finite(v.x) && finite(v.y) && finite(v.z)
}

/// Vector number `index` of a packed list.
#[cube]
pub(crate) fn read3(values: &[f32], index: usize) -> Vec3 {
    let base = index * 3;
    Vec3 { x: values[base], y: values[base + 1], z: values[base + 2] }
}

/// Writes vector number `index` of a packed list that begins at `start`.
#[cube]
pub(crate) fn write3(values: &mut [f32], start: usize, index: usize, v: Vec3) {
    let base = start + index * 3;
    values[base] = v.x;
    values[base + 1] = v.y;
    values[base + 2] = v.z;
}

/// Scalar product.
#[cube]
pub(crate) fn dot(a: Vec3, b: Vec3) -> f32 {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// Vector product.
#[cube]
pub(crate) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    Vec3 { x: a.y * b.z - a.z * b.y, y: a.z * b.x - a.x * b.z, z: a.x * b.y - a.y * b.x }
}

/// Sum.
#[cube]
pub(crate) fn add(a: Vec3, b: Vec3) -> Vec3 {
    Vec3 { x: a.x + b.x, y: a.y + b.y, z: a.z + b.z }
}

/// Product by components.
#[cube]
pub(crate) fn times(a: Vec3, b: Vec3) -> Vec3 {
    Vec3 { x: a.x * b.x, y: a.y * b.y, z: a.z * b.z }
}

/// `s a`.
#[cube]
pub(crate) fn scaled(s: f32, a: Vec3) -> Vec3 {
    Vec3 { x: s * a.x, y: s * a.y, z: s * a.z }
}

/// `s a + t b`.
#[cube]
pub(crate) fn combine(s: f32, a: Vec3, t: f32, b: Vec3) -> Vec3 {
    Vec3 { x: s * a.x + t * b.x, y: s * a.y + t * b.y, z: s * a.z + t * b.z }
}

/// `m v`.
#[cube]
pub(crate) fn mat_vec(m: Mat3, v: Vec3) -> Vec3 {
    Vec3 { x: dot(m.a, v), y: dot(m.b, v), z: dot(m.c, v) }
}

/// `m^T v`.
#[cube]
pub(crate) fn mat_t_vec(m: Mat3, v: Vec3) -> Vec3 {
    Vec3 {
        x: m.a.x * v.x + m.b.x * v.y + m.c.x * v.z,
        y: m.a.y * v.x + m.b.y * v.y + m.c.y * v.z,
        z: m.a.z * v.x + m.b.z * v.y + m.c.z * v.z,
    }
}

/// Squared norm of a quaternion.
#[cube]
pub(crate) fn norm2(q: Quat) -> f32 {
    q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z
}

/// Rotation matrix of a unit quaternion.
#[cube]
pub(crate) fn rotation(q: Quat) -> Mat3 {
    Mat3 {
        a: Vec3 {
            x: 1.0f32 - 2.0f32 * (q.y * q.y + q.z * q.z),
            y: 2.0f32 * (q.x * q.y - q.w * q.z),
            z: 2.0f32 * (q.x * q.z + q.w * q.y),
        },
        b: Vec3 {
            x: 2.0f32 * (q.x * q.y + q.w * q.z),
            y: 1.0f32 - 2.0f32 * (q.x * q.x + q.z * q.z),
            z: 2.0f32 * (q.y * q.z - q.w * q.x),
        },
        c: Vec3 {
            x: 2.0f32 * (q.x * q.z - q.w * q.y),
            y: 2.0f32 * (q.y * q.z + q.w * q.x),
            z: 1.0f32 - 2.0f32 * (q.x * q.x + q.y * q.y),
        },
    }
}

/// Gradient by the unit quaternion from the gradient `v` by its rotation matrix.
#[cube]
pub(crate) fn rotation_vjp(q: Quat, v: Mat3) -> Quat {
    let skew_x = v.c.y - v.b.z;
    let skew_y = v.a.z - v.c.x;
    let skew_z = v.b.x - v.a.y;
    let sym_xy = v.a.y + v.b.x;
    let sym_xz = v.a.z + v.c.x;
    let sym_yz = v.b.z + v.c.y;
    Quat {
        w: 2.0f32 * (q.x * skew_x + q.y * skew_y + q.z * skew_z),
        x: 2.0f32 * (q.w * skew_x + q.y * sym_xy + q.z * sym_xz - 2.0f32 * q.x * (v.b.y + v.c.z)),
        y: 2.0f32 * (q.w * skew_y + q.x * sym_xy + q.z * sym_yz - 2.0f32 * q.y * (v.a.x + v.c.z)),
        z: 2.0f32 * (q.w * skew_z + q.x * sym_xz + q.y * sym_yz - 2.0f32 * q.z * (v.a.x + v.b.y)),
    }
}

/// Gradient by `q` from the gradient `v` by `unit = q / norm`.
#[cube]
pub(crate) fn normalise_vjp(unit: Quat, norm: f32, v: Quat) -> Quat {
    let along = unit.w * v.w + unit.x * v.x + unit.y * v.y + unit.z * v.z;
    Quat {
        w: (v.w - unit.w * along) / norm,
        x: (v.x - unit.x * along) / norm,
        y: (v.y - unit.y * along) / norm,
        z: (v.z - unit.z * along) / norm,
    }
}
