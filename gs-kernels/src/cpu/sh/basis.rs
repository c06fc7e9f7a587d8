//! The basis, the direction it is evaluated in, and the sum over it.

use crate::cpu::Real;
use crate::cpu::math::{Vec3, dot};

/// Coefficients of degree 3.
pub const MAX_COEFFICIENTS: usize = 16;
/// `Y_0`.
pub const SH_C0: f64 = 0.282_094_791_773_878_14;
/// Scale of the linear terms.
pub const SH_C1: f64 = 0.488_602_511_902_919_9;
/// Scales of the quadratic terms.
pub const SH_C2: [f64; 5] = [
    1.092_548_430_592_079_2,
    -1.092_548_430_592_079_2,
    0.315_391_565_252_520_05,
    -1.092_548_430_592_079_2,
    0.546_274_215_296_039_6,
];
/// Scales of the cubic terms.
pub const SH_C3: [f64; 7] = [
    -0.590_043_589_926_643_5,
    2.890_611_442_640_554,
    -0.457_045_799_464_465_8,
    0.373_176_332_590_115_4,
    -0.457_045_799_464_465_8,
    1.445_305_721_320_277,
    -0.590_043_589_926_643_5,
];

/// The basis up to `degree` at the unit vector `[x, y, z]`; the rest is zero.
#[inline(always)]
pub(super) fn basis<F: Real>(degree: u32, [x, y, z]: Vec3<F>) -> [F; MAX_COEFFICIENTS] {
    let mut b = [F::ZERO; MAX_COEFFICIENTS];
    let c = F::of;
    b[0] = c(SH_C0);
    if degree >= 1 {
        b[1] = c(-SH_C1) * y;
        b[2] = c(SH_C1) * z;
        b[3] = c(-SH_C1) * x;
    }
    if degree >= 2 {
        b[4] = c(SH_C2[0]) * x * y;
        b[5] = c(SH_C2[1]) * y * z;
        b[6] = c(SH_C2[2]) * (c(2.0) * z * z - x * x - y * y);
        b[7] = c(SH_C2[3]) * x * z;
        b[8] = c(SH_C2[4]) * (x * x - y * y);
    }
    if degree >= 3 {
        b[9] = c(SH_C3[0]) * y * (c(3.0) * x * x - y * y);
        b[10] = c(SH_C3[1]) * x * y * z;
        b[11] = c(SH_C3[2]) * y * (c(4.0) * z * z - x * x - y * y);
        b[12] = c(SH_C3[3]) * z * (c(2.0) * z * z - c(3.0) * x * x - c(3.0) * y * y);
        b[13] = c(SH_C3[4]) * x * (c(4.0) * z * z - x * x - y * y);
        b[14] = c(SH_C3[5]) * z * (x * x - y * y);
        b[15] = c(SH_C3[6]) * x * (x * x - c(3.0) * y * y);
    }
    b
}

/// Gradient by the unit vector from the gradient `v` by [`basis`].
#[inline(always)]
pub(super) fn basis_vjp<F: Real>(degree: u32, [x, y, z]: Vec3<F>, v: &[F; MAX_COEFFICIENTS]) -> Vec3<F> {
    let c = F::of;
    let (mut gx, mut gy, mut gz) = (F::ZERO, F::ZERO, F::ZERO);
    if degree >= 1 {
        gy += c(-SH_C1) * v[1];
        gz += c(SH_C1) * v[2];
        gx += c(-SH_C1) * v[3];
    }
    if degree >= 2 {
        let mut k = [F::ZERO; 5];
        for i in 0..5 {
            k[i] = c(SH_C2[i]) * v[4 + i];
        }
        let [k4, k5, k6, k7, k8] = k;
        let two = c(2.0);
        gx += k4 * y - two * k6 * x + k7 * z + two * k8 * x;
        gy += k4 * x + k5 * z - two * k6 * y - two * k8 * y;
        gz += k5 * y + c(4.0) * k6 * z + k7 * x;
    }
    if degree >= 3 {
        let mut k = [F::ZERO; 7];
        for i in 0..7 {
            k[i] = c(SH_C3[i]) * v[9 + i];
        }
        let [k9, k10, k11, k12, k13, k14, k15] = k;
        let (xx, yy, zz, xy, xz, yz) = (x * x, y * y, z * z, x * y, x * z, y * z);
        let (two, three, six, eight) = (c(2.0), c(3.0), c(6.0), c(8.0));
        gx += six * k9 * xy + k10 * yz - two * k11 * xy - six * k12 * xz
            + k13 * (c(4.0) * zz - three * xx - yy)
            + two * k14 * xz
            + three * k15 * (xx - yy);
        gy += three * k9 * (xx - yy) + k10 * xz + k11 * (c(4.0) * zz - xx - three * yy)
            - six * k12 * yz
            - two * k13 * xy
            - two * k14 * yz
            - six * k15 * xy;
        gz += k10 * xy
            + eight * k11 * yz
            + k12 * (six * zz - three * xx - three * yy)
            + eight * k13 * xz
            + k14 * (xx - yy);
    }
    [gx, gy, gz]
}

/// Unit vector from the camera, and the distance; at the camera itself the direction is zero and has no gradient.
#[inline(always)]
pub(super) fn direction<F: Real>(mean: Vec3<F>, centre: Vec3<F>) -> (Vec3<F>, F) {
    let offset = [mean[0] - centre[0], mean[1] - centre[1], mean[2] - centre[2]];
    let distance = dot(offset, offset).sqrt();
    if distance > F::ZERO && distance.is_finite() {
        ([offset[0] / distance, offset[1] / distance, offset[2] / distance], distance)
    } else {
        ([F::ZERO; 3], F::ONE)
    }
}

/// `1/2 + sum_k b_k sh_k` over the first `USED` coefficients.
#[inline(always)]
pub(super) fn raw_colour<F: Real, const USED: usize>(b: &[F; MAX_COEFFICIENTS], sh: &[F]) -> Vec3<F> {
    let sh = &sh[..3 * USED];
    let mut colour = [F::of(0.5); 3];
    for k in 0..USED {
        for c in 0..3 {
            colour[c] += b[k] * sh[3 * k + c];
        }
    }
    colour
}
