//! The projection in plain tensor operations.

use burn::tensor::{Bool, Tensor};
use gs_kernels::config::ProjectionConfig;
use gs_kernels::constants::{COMPENSATION_RATIO_MIN, COV2D_MAX, CUTOFF_SIGMAS, QUAT_NORM2_MAX, QUAT_NORM2_MIN};
use gs_kernels::rows::PROJECTED;

/// Reference of [`project`](super::project): the same arguments, result and gradients, one tensor operation at a time.
///
/// # Panics
/// When shapes or float types disagree.
pub fn project_reference(
    means: Tensor<2>,
    quats: Tensor<2>,
    log_scales: Tensor<2>,
    viewmat: Tensor<2>,
    config: &ProjectionConfig,
) -> Tensor<2> {
    super::check(&means, &quats, &log_scales, &viewmat);
    let [count, _] = means.dims();
    if count == 0 {
        return means.repeat_dim(1, PROJECTED).narrow(1, 0, PROJECTED);
    }
    let fixed = [&means, &quats, &log_scales, &viewmat].map(|tensor| tensor.clone().detach());
    let culled = culled(&fixed, config);
    // Culled Gaussians are replaced by one in front of the camera before the differentiable pass: even a masked result
    // would otherwise send back 0 * inf = NaN.
    let [_, _, _, fixed_viewmat] = fixed;
    let spare = Tensor::<2>::from_data([[1.0, 0.0, 0.0, 0.0]], (&quats.device(), quats.dtype()));
    let means = means.mask_where(wide(&culled, 3), in_front(fixed_viewmat).expand([count, 3]));
    let quats = quats.mask_where(wide(&culled, 4), spare.expand([count, 4]));
    let log_scales = log_scales.mask_fill(wide(&culled, 3), 0.0);
    Ellipses::project(means, quats, log_scales, viewmat, config).rows().mask_fill(wide(&culled, PROJECTED), 0.0)
}

fn wide(mask: &Tensor<2, Bool>, columns: usize) -> Tensor<2, Bool> {
    let [count, _] = mask.dims();
    mask.clone().expand([count, columns])
}

/// The world point at depth 1 on the camera's axis, `R^T ([0, 0, 1] - t)`, `[1, 3]`.
fn in_front(viewmat: Tensor<2>) -> Tensor<2> {
    let (rotation, translation) = pose(viewmat);
    let axis = Tensor::<2>::from_data([[0.0, 0.0, 1.0]], (&rotation.device(), rotation.dtype()));
    (axis - translation).matmul(rotation)
}

/// Rotation `[3, 3]` and translation `[1, 3]`.
fn pose(viewmat: Tensor<2>) -> (Tensor<2>, Tensor<2>) {
    let top = viewmat.narrow(0, 0, 3);
    (top.clone().narrow(1, 0, 3), top.narrow(1, 3, 1).transpose())
}

/// Whether each Gaussian is culled, `[N, 1]`. NaN fails every comparison, so each condition states what must hold.
fn culled([means, quats, log_scales, viewmat]: &[Tensor<2>; 4], config: &ProjectionConfig) -> Tensor<2, Bool> {
    let finite = |tensor: &Tensor<2>| tensor.clone().is_finite().all_dim(1);
    let norm2 = quats.clone().square().sum_dim(1);
    let ellipses = Ellipses::project(means.clone(), quats.clone(), log_scales.clone(), viewmat.clone(), config);
    let Ellipses { mean_x, mean_y, depth, xx, xy, yy, det, .. } = &ellipses;
    let drawable = finite(means)
        & finite(quats)
        & finite(log_scales)
        & norm2.clone().greater_equal_elem(QUAT_NORM2_MIN)
        & norm2.lower_equal_elem(QUAT_NORM2_MAX)
        & depth.clone().greater_equal_elem(config.near)
        & depth.clone().lower_equal_elem(config.far)
        & xx.clone().lower_equal_elem(COV2D_MAX)
        & yy.clone().lower_equal_elem(COV2D_MAX)
        & xy.clone().abs().lower_equal_elem(COV2D_MAX)
        & det.clone().greater_elem(0.0);
    let seen = |mean: &Tensor<2>, variance: &Tensor<2>, size: u32| {
        let reach = variance.clone().sqrt() * CUTOFF_SIGMAS;
        (mean.clone() + reach.clone()).greater_elem(0.0) & (mean.clone() - reach).lower_elem(f64::from(size))
    };
    let inside = seen(mean_x, xx, config.width) & seen(mean_y, yy, config.height);
    !(drawable & inside & finite(&ellipses.rows()))
}

/// Projected Gaussians, every field `[N, 1]`.
struct Ellipses {
    mean_x: Tensor<2>,
    mean_y: Tensor<2>,
    depth: Tensor<2>,
    /// Dilated covariance.
    xx: Tensor<2>,
    xy: Tensor<2>,
    yy: Tensor<2>,
    det: Tensor<2>,
    compensation: Tensor<2>,
}

impl Ellipses {
    fn project(
        means: Tensor<2>,
        quats: Tensor<2>,
        log_scales: Tensor<2>,
        viewmat: Tensor<2>,
        config: &ProjectionConfig,
    ) -> Self {
        let [count, _] = means.dims();
        let (rotation, translation) = pose(viewmat);
        let p = means.matmul(rotation.clone().transpose()) + translation;
        let [x, y, depth] = columns(p);
        let slope = [x / depth.clone(), y / depth.clone()];
        let [mean_x, mean_y] = [slope[0].clone() * config.fx + config.cx, slope[1].clone() * config.fy + config.cy];

        // The Jacobian is evaluated inside the frustum limits.
        let [x_min, x_max, y_min, y_max] = config.frustum_limits();
        let [slope_x, slope_y] = slope;
        let (slope_x, slope_y) = (slope_x.clamp(x_min, x_max), slope_y.clamp(y_min, y_max));
        let zero = depth.zeros_like();
        let jacobian_x = Tensor::cat(vec![depth.ones_like(), zero.clone(), -slope_x], 1) / depth.clone() * config.fx;
        let jacobian_y = Tensor::cat(vec![zero, depth.ones_like(), -slope_y], 1) / depth.clone() * config.fy;
        let jacobian: Tensor<3> = Tensor::stack(vec![jacobian_x, jacobian_y], 1);

        // Rows of J W R S: C = (J W R S)(J W R S)^T + eps I.
        let to_image = jacobian.matmul(rotation.unsqueeze::<3>().expand([count, 3, 3]));
        let half = to_image.matmul(rotations(quats)) * log_scales.exp().unsqueeze_dim(1);
        let [first, second] = [0, 1].map(|row| half.clone().narrow(1, row, 1).squeeze_dim::<2>(1));
        let dot = |a: &Tensor<2>, b: &Tensor<2>| (a.clone() * b.clone()).sum_dim(1);
        let (xx, xy, yy) = (dot(&first, &first), dot(&first, &second), dot(&second, &second));
        // The determinant as a sum of squares: xx yy - xy^2 cancels for needles.
        let normal = cross(first, second);
        let sharp_det = dot(&normal, &normal);
        let det = sharp_det.clone() + (xx.clone() + yy.clone()) * config.eps2d + config.eps2d * config.eps2d;
        let compensation = if config.antialiased {
            (sharp_det / det.clone()).clamp_min(COMPENSATION_RATIO_MIN).sqrt()
        } else {
            depth.ones_like()
        };
        let (xx, yy) = (xx + config.eps2d, yy + config.eps2d);
        Self { mean_x, mean_y, depth, xx, xy, yy, det, compensation }
    }

    /// Packed rows `[N, 8]`.
    fn rows(&self) -> Tensor<2> {
        let Self { mean_x, mean_y, depth, xx, xy, yy, det, compensation } = self;
        let d1 = yy.clone() / det.clone();
        let l = -(xy.clone() / yy.clone());
        let d2 = yy.clone().recip();
        let radius = xx.clone().max_pair(yy.clone()).detach().sqrt() * CUTOFF_SIGMAS;
        let fields = [mean_x.clone(), mean_y.clone(), d1, l, d2, depth.clone(), compensation.clone(), radius];
        Tensor::cat(fields.to_vec(), 1)
    }
}

/// Rotation matrices `[N, 3, 3]` of unnormalised quaternions w x y z.
fn rotations(quats: Tensor<2>) -> Tensor<3> {
    let [count, _] = quats.dims();
    let norm = quats.clone().square().sum_dim(1).sqrt();
    let [w, x, y, z] = columns(quats / norm);
    let product = |a: &Tensor<2>, b: &Tensor<2>| a.clone() * b.clone() * 2.0;
    let diagonal = |a: &Tensor<2>, b: &Tensor<2>| -(product(a, a) + product(b, b)) + 1.0;
    let entries = vec![
        diagonal(&y, &z),
        product(&x, &y) - product(&w, &z),
        product(&x, &z) + product(&w, &y),
        product(&x, &y) + product(&w, &z),
        diagonal(&x, &z),
        product(&y, &z) - product(&w, &x),
        product(&x, &z) - product(&w, &y),
        product(&y, &z) + product(&w, &x),
        diagonal(&x, &y),
    ];
    Tensor::cat(entries, 1).reshape([count, 3, 3])
}

fn columns<const C: usize>(tensor: Tensor<2>) -> [Tensor<2>; C] {
    std::array::from_fn(|column| tensor.clone().narrow(1, column, 1))
}

/// Row-wise cross product of `[N, 3]` tensors.
fn cross(a: Tensor<2>, b: Tensor<2>) -> Tensor<2> {
    let ([ax, ay, az], [bx, by, bz]) = (columns(a), columns(b));
    Tensor::cat(
        vec![ay.clone() * bz.clone() - az.clone() * by.clone(), az * bx.clone() - ax.clone() * bz, ax * by - ay * bx],
        1,
    )
}
