//! Statistics of classic density control (3DGS, section 5.2), in place where memory allows. They have no gradient.

use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::tensor::{Tensor, assert_shape};
pub use gs_kernels::config::StatisticsConfig;
use gs_kernels::cpu::statistics as cpu;
use gs_kernels::rows::SCREEN;

use super::assert_same_dtype;
use super::operation::{Computation, Tensors, computed};
use crate::slices::{HostBackend, HostTensor, with_float};

/// Adds one view to the statistics `gradient` `[N]` and `views` `[N]`, and returns them.
///
/// - `screen` `[N, 4]`: the gradient of [`Extras::screen`](crate::Extras::screen). The length of its
///   signed or absolute part (`config.absolute`), by image coordinates from -1 to 1, is added to `gradient`.
/// - `rows` `[N, config.columns]`: their last column is the radius of a Gaussian in the image, as in the rows of
///   [`project`](super::projection::project); where it is positive, 1 is added to `views`.
///
/// One launch on a GPU. Gradient tracking is dropped.
///
/// # Panics
/// When shapes or float types disagree.
pub fn gather_statistics(
    gradient: Tensor<1>,
    views: Tensor<1>,
    screen: Tensor<2>,
    rows: Tensor<2>,
    config: &StatisticsConfig,
) -> (Tensor<1>, Tensor<1>) {
    let [count] = gradient.dims();
    assert_shape!(views, [count]);
    assert_shape!(screen, [count, SCREEN]);
    assert_shape!(rows, [count, config.columns]);
    assert_same_dtype("views", &views, "gradient", &gradient);
    assert_same_dtype("screen", &screen, "gradient", &gradient);
    assert_same_dtype("rows", &rows, "gradient", &gradient);
    let [gradient, views] = [gradient, views].map(|tensor| tensor.inner().into_dispatch());
    let [screen, rows] = [screen, rows].map(|tensor| tensor.inner().into_dispatch());
    let gathered = computed(Statistics(*config), [gradient, views, screen, rows], []);
    let ([gradient, views], []) = gathered.into_arrays();
    (Tensor::from_dispatch(gradient), Tensor::from_dispatch(views))
}

/// [`gather_statistics`] in Burn's tensor operations: the definition.
pub fn gather_statistics_reference(
    gradient: Tensor<1>,
    views: Tensor<1>,
    screen: Tensor<2>,
    rows: Tensor<2>,
    config: &StatisticsConfig,
) -> (Tensor<1>, Tensor<1>) {
    let [half_width, half_height] = config.halves();
    let column = |table: &Tensor<2>, index: usize| table.clone().narrow(1, index, 1).squeeze_dim::<1>(1);
    let first = config.first_column();
    let (x, y) = (column(&screen, first) * half_width, column(&screen, first + 1) * half_height);
    let seen = column(&rows, config.columns - 1).greater_elem(0.0).float().cast(views.dtype());
    (gradient + (x.clone() * x + y.clone() * y).sqrt(), views + seen)
}

/// [`gather_statistics`] as a computation on the sums so far, screen gradients and rows; the results are the sums.
pub(crate) struct Statistics(pub(crate) StatisticsConfig);

impl Computation<4> for Statistics {
    fn compute<B: HostBackend>(
        &self,
        [mut gradient, mut views, screen, rows]: [FloatTensor<B>; 4],
        []: [IntTensor<B>; 0],
    ) -> Tensors<B> {
        with_float!(gradient, F => {
            let screen = screen.elements::<F>();
            cpu::gather(gradient.elements_mut(), views.elements_mut(), screen, rows.elements(), &self.0);
        });
        Tensors::of_floats([gradient, views])
    }
}
