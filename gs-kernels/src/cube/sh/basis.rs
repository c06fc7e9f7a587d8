//! The basis, the direction it is evaluated in, and the sum over it.

use cubecl::prelude::*;

use crate::cpu::sh::{SH_C0, SH_C1, SH_C2, SH_C3};
use crate::cube::camera::Pose;
use crate::cube::math::{Vec3, combine, dot, finite, mat_t_vec, scaled};

const Y0: f32 = SH_C0 as f32;
const Y1: f32 = SH_C1 as f32;
const Y2: [f32; 5] = [SH_C2[0] as f32, SH_C2[1] as f32, SH_C2[2] as f32, SH_C2[3] as f32, SH_C2[4] as f32];
const Y3: [f32; 7] = [
    SH_C3[0] as f32,
    SH_C3[1] as f32,
    SH_C3[2] as f32,
    SH_C3[3] as f32,
    SH_C3[4] as f32,
    SH_C3[5] as f32,
    SH_C3[6] as f32,
];

/// The camera's centre in the world, `-R^T t`.
#[cube]
pub(super) fn centre(pose: Pose) -> Vec3 {
    scaled(-1.0f32, mat_t_vec(pose.rotation, pose.translation))
}

/// Unit vector from the camera and the distance; at the camera itself the direction is zero and has no gradient.
#[derive(CubeType, Clone, Copy)]
#[expand(derive(Clone, Copy))]
pub(super) struct Direction {
    pub(super) unit: Vec3,
    pub(super) distance: f32,
}

#[cube]
pub(super) fn direction(mean: Vec3, centre: Vec3) -> Direction {
    let offset = combine(1.0f32, mean, -1.0f32, centre);
    let distance2 = dot(offset, offset);
    let known = finite(distance2) && distance2 > 0.0f32;
    let distance = select(known, distance2, 1.0f32).sqrt();
    let unit = Vec3 {
        x: select(known, offset.x / distance, 0.0f32),
        y: select(known, offset.y / distance, 0.0f32),
        z: select(known, offset.z / distance, 0.0f32),
    };
    Direction { unit, distance }
}

/// The basis up to `degree` at the unit vector `d`, into `b`.
#[cube]
pub(super) fn basis(#[comptime] degree: u32, d: Vec3, b: &mut Array<f32>) {
    let x = d.x;
    let y = d.y;
    let z = d.z;
    b[0] = f32::new(Y0);
    if comptime!(degree >= 1) {
        b[1] = -Y1 * y;
        b[2] = Y1 * z;
        b[3] = -Y1 * x;
    }
    if comptime!(degree >= 2) {
        b[4] = comptime!(Y2[0]) * x * y;
        b[5] = comptime!(Y2[1]) * y * z;
        b[6] = comptime!(Y2[2]) * (2.0f32 * z * z - x * x - y * y);
        b[7] = comptime!(Y2[3]) * x * z;
        b[8] = comptime!(Y2[4]) * (x * x - y * y);
    }
    if comptime!(degree >= 3) {
        b[9] = comptime!(Y3[0]) * y * (3.0f32 * x * x - y * y);
        b[10] = comptime!(Y3[1]) * x * y * z;
        b[11] = comptime!(Y3[2]) * y * (4.0f32 * z * z - x * x - y * y);
        b[12] = comptime!(Y3[3]) * z * (2.0f32 * z * z - 3.0f32 * x * x - 3.0f32 * y * y);
        b[13] = comptime!(Y3[4]) * x * (4.0f32 * z * z - x * x - y * y);
        b[14] = comptime!(Y3[5]) * z * (x * x - y * y);
        b[15] = comptime!(Y3[6]) * x * (x * x - 3.0f32 * y * y);
    }
}

/// Gradient by the unit vector from the gradient `v` by [`basis`].
#[cube]
pub(super) fn basis_vjp(#[comptime] degree: u32, d: Vec3, v: &Array<f32>) -> Vec3 {
    let x = d.x;
    let y = d.y;
    let z = d.z;
    let mut gx = 0.0f32;
    let mut gy = 0.0f32;
    let mut gz = 0.0f32;
    if comptime!(degree >= 1) {
        gx -= Y1 * v[3];
        gy -= Y1 * v[1];
        gz += Y1 * v[2];
    }
    if comptime!(degree >= 2) {
        let k4 = comptime!(Y2[0]) * v[4];
        let k5 = comptime!(Y2[1]) * v[5];
        let k6 = comptime!(Y2[2]) * v[6];
        let k7 = comptime!(Y2[3]) * v[7];
        let k8 = comptime!(Y2[4]) * v[8];
        gx += k4 * y - 2.0f32 * k6 * x + k7 * z + 2.0f32 * k8 * x;
        gy += k4 * x + k5 * z - 2.0f32 * k6 * y - 2.0f32 * k8 * y;
        gz += k5 * y + 4.0f32 * k6 * z + k7 * x;
    }
    if comptime!(degree >= 3) {
        let k9 = comptime!(Y3[0]) * v[9];
        let k10 = comptime!(Y3[1]) * v[10];
        let k11 = comptime!(Y3[2]) * v[11];
        let k12 = comptime!(Y3[3]) * v[12];
        let k13 = comptime!(Y3[4]) * v[13];
        let k14 = comptime!(Y3[5]) * v[14];
        let k15 = comptime!(Y3[6]) * v[15];
        let xx = x * x;
        let yy = y * y;
        let zz = z * z;
        gx += 6.0f32 * k9 * x * y + k10 * y * z - 2.0f32 * k11 * x * y - 6.0f32 * k12 * x * z
            + k13 * (4.0f32 * zz - 3.0f32 * xx - yy)
            + 2.0f32 * k14 * x * z
            + 3.0f32 * k15 * (xx - yy);
        gy += 3.0f32 * k9 * (xx - yy) + k10 * x * z + k11 * (4.0f32 * zz - xx - 3.0f32 * yy)
            - 6.0f32 * k12 * y * z
            - 2.0f32 * k13 * x * y
            - 2.0f32 * k14 * y * z
            - 6.0f32 * k15 * x * y;
        gz += k10 * x * y
            + 8.0f32 * k11 * y * z
            + k12 * (6.0f32 * zz - 3.0f32 * xx - 3.0f32 * yy)
            + 8.0f32 * k13 * x * z
            + k14 * (xx - yy);
    }
    Vec3 { x: gx, y: gy, z: gz }
}

/// `1/2 + sum_k b_k sh_k`, not yet clamped at zero, of the Gaussian's own coefficients.
#[cube]
pub(super) fn raw_colour(b: &Array<f32>, sh: &Array<f32>, #[comptime] used: usize) -> Vec3 {
    let mut r = 0.5f32;
    let mut g = 0.5f32;
    let mut blue = 0.5f32;
    #[unroll]
    for k in 0..used {
        r += b[k] * sh[3 * k];
        g += b[k] * sh[3 * k + 1];
        blue += b[k] * sh[3 * k + 2];
    }
    Vec3 { x: r, y: g, z: blue }
}
