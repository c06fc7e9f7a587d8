//! Spherical harmonics in plain tensor operations.

use burn::tensor::{DType, Device, Tensor};
use gs_kernels::constants::INVALID_FEATURE;
use gs_kernels::cpu::sh::{SH_C0, SH_C1, SH_C2, SH_C3};

use crate::ops::columns;

/// Reference of [`sh_colors`](super::sh_colors): the same arguments, result and gradients, one tensor operation at a
/// time.
///
/// # Panics
/// When shapes or float types disagree, or `degree` exceeds the stored degree.
pub fn sh_colors_reference(
    means: Tensor<2>,
    sh: Tensor<3>,
    viewmat: Tensor<2>,
    projected: Tensor<2>,
    degree: usize,
) -> Tensor<2> {
    super::check(&means, &sh, &viewmat, &projected, degree);
    let [count, _] = means.dims();
    if count == 0 {
        return means;
    }
    let colors = |means: Tensor<2>, sh: Tensor<3>| {
        let used = (degree + 1) * (degree + 1);
        let basis: Tensor<3> = basis(degree, directions(means, viewmat.clone())).unsqueeze_dim(2);
        (basis * sh.narrow(1, 0, used)).sum_dim(1).squeeze_dim::<2>(1) + 0.5
    };
    let culled = columns::radius(projected.inner()).equal_elem(0.0);
    let plain = colors(means.clone().detach(), sh.clone().detach()).detach();
    let broken = !plain.is_finite().all_dim(1) & !culled.clone();
    // Gaussians that are not drawn are replaced by harmless values before the differentiable pass, or they would send
    // back 0 * inf = NaN.
    let skipped = culled.clone() | broken.clone();
    let [_, coefficients, _] = sh.dims();
    let sh = sh.mask_fill(skipped.clone().unsqueeze_dim::<3>(2).expand([count, coefficients, 3]), 0.0);
    let ahead = ahead_of(viewmat.clone().detach());
    let means = means.mask_where(skipped.expand([count, 3]), ahead.expand([count, 3]));
    colors(means, sh)
        .clamp_min(0.0)
        .mask_fill(broken.expand([count, 3]), INVALID_FEATURE)
        .mask_fill(culled.expand([count, 3]), 0.0)
}

/// The camera's centre `-R^T t`, `[1, 3]`.
fn centre(viewmat: Tensor<2>) -> Tensor<2> {
    let top = viewmat.narrow(0, 0, 3);
    -top.clone().narrow(1, 3, 1).transpose().matmul(top.narrow(1, 0, 3))
}

/// A point one unit away from the camera, `[1, 3]`.
fn ahead_of(viewmat: Tensor<2>) -> Tensor<2> {
    let axis = viewmat.clone().slice([2..3, 0..3]);
    centre(viewmat) + axis
}

/// Unit vectors from the camera, `[N, 3]`.
fn directions(means: Tensor<2>, viewmat: Tensor<2>) -> Tensor<2> {
    let offset = means - centre(viewmat);
    let distance = offset.clone().square().sum_dim(1).sqrt();
    offset / distance
}

/// The basis up to `degree`, `[N, (degree + 1)^2]`.
fn basis(degree: usize, directions: Tensor<2>) -> Tensor<2> {
    let (device, dtype): (Device, DType) = (directions.device(), directions.dtype());
    let [count, _] = directions.dims();
    let [x, y, z]: [Tensor<2>; 3] = std::array::from_fn(|axis| directions.clone().narrow(1, axis, 1));
    let product = |a: &Tensor<2>, b: &Tensor<2>| a.clone() * b.clone();
    let (xx, yy, zz) = (product(&x, &x), product(&y, &y), product(&z, &z));
    let (xy, yz, xz) = (product(&x, &y), product(&y, &z), product(&x, &z));
    let mut basis = vec![Tensor::ones([count, 1], (&device, dtype)) * SH_C0];
    if degree >= 1 {
        basis.extend([y.clone() * -SH_C1, z.clone() * SH_C1, x.clone() * -SH_C1]);
    }
    if degree >= 2 {
        basis.extend([
            xy.clone() * SH_C2[0],
            yz * SH_C2[1],
            (zz.clone() * 2.0 - xx.clone() - yy.clone()) * SH_C2[2],
            xz * SH_C2[3],
            (xx.clone() - yy.clone()) * SH_C2[4],
        ]);
    }
    if degree >= 3 {
        let across = zz.clone() * 4.0 - xx.clone() - yy.clone();
        basis.extend([
            y.clone() * (xx.clone() * 3.0 - yy.clone()) * SH_C3[0],
            xy * z.clone() * SH_C3[1],
            y * across.clone() * SH_C3[2],
            z.clone() * (zz * 2.0 - xx.clone() * 3.0 - yy.clone() * 3.0) * SH_C3[3],
            x.clone() * across * SH_C3[4],
            z * (xx.clone() - yy.clone()) * SH_C3[5],
            x * (xx - yy * 3.0) * SH_C3[6],
        ]);
    }
    Tensor::cat(basis, 1)
}
