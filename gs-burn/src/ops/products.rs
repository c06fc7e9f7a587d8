//! Products whose gradients are sums over many rows.
//!
//! On a GPU, Burn gives such a sum to one unit per result: the gradient of a bias over all pixels of an image is a loop
//! of a million additions in 32 units. Here the rows are cut into groups, in one order. On a CPU the operations are
//! Burn's own.

use burn::backend::tensor::{FloatTensor, IntTensor};
use burn::backend::{Backend, TensorMetadata};
use burn::tensor::{Shape, Tensor, assert_shape};

use super::operation::{Computation, Operation, Output, State, Tensors, computed_tensor, differentiable};
use crate::slices::HostBackend;

/// `rows weight + bias`, `[R, out]`, of `rows` `[R, in]`, `weight` `[in, out]` and `bias` `[out]`: a layer of a
/// network. Differentiable by all three. On CUDA the product may be computed in TF32.
///
/// # Panics
/// When shapes disagree.
pub fn affine(rows: Tensor<2>, weight: Tensor<2>, bias: Tensor<1>) -> Tensor<2> {
    let ([_, inner], [_, outer]) = (rows.dims(), weight.dims());
    assert_shape!(weight, [inner, outer]);
    assert_shape!(bias, [outer]);
    differentiable(Affine, [rows.into_dispatch(), weight.into_dispatch(), bias.into_dispatch()], [])
}

/// `factors[s] rows[r, c]`, `[S, R, C]`, of `factors` `[S]` and `rows` `[R, C]`. Differentiable by both.
pub fn scaled(factors: Tensor<1>, rows: Tensor<2>) -> Tensor<3> {
    differentiable(Scaled, [factors.into_dispatch(), rows.into_dispatch()], [])
}

/// `a^T b`, `[I, O]`, of `a` `[R, I]` and `b` `[R, O]`, with full precision. Gradient tracking is dropped.
///
/// # Panics
/// When the numbers of rows disagree.
pub fn transposed_product(a: Tensor<2>, b: Tensor<2>) -> Tensor<2> {
    let ([rows, _], [_, outer]) = (a.dims(), b.dims());
    assert_shape!(b, [rows, outer]);
    computed_tensor(TransposedProduct, [a, b].map(|tensor| tensor.inner().into_dispatch()))
}

/// The sums over rows on a backend's primitives, without gradient tracking. The default bodies are plain tensor
/// operations.
pub(crate) trait RowSums: Backend {
    /// `a^T b`, `[I, O]`, of `a` `[R, I]` and `b` `[R, O]`.
    fn transposed(a: FloatTensor<Self>, b: FloatTensor<Self>) -> FloatTensor<Self> {
        Self::float_matmul(Self::float_transpose(a), b)
    }

    /// The sum of the rows of `b` `[R, O]`, `[O]`.
    fn column_sums(b: FloatTensor<Self>) -> FloatTensor<Self> {
        let outer = b.shape()[1];
        Self::float_reshape(Self::float_sum_dim(b, 0), Shape::new([outer]))
    }

    /// For each `s` the sum of `v[s, r, c] rows[r, c]`, `[S]`.
    fn dots(v: FloatTensor<Self>, rows: FloatTensor<Self>) -> FloatTensor<Self> {
        let [lines, count, columns] = v.shape().dims();
        let rows = Self::float_reshape(rows, Shape::new([1, count, columns]));
        let products = Self::float_reshape(Self::float_mul(v, rows), Shape::new([lines, count * columns]));
        Self::float_reshape(Self::float_sum_dim(products, 1), Shape::new([lines]))
    }
}

impl<B: HostBackend> RowSums for B {}

/// [`affine`] as an operation.
#[derive(Clone, Debug)]
pub(crate) struct Affine;

impl Affine {
    pub(crate) fn product<B: Backend>(
        rows: FloatTensor<B>,
        weight: FloatTensor<B>,
        bias: FloatTensor<B>,
    ) -> FloatTensor<B> {
        let (count, outer) = (rows.shape()[0], bias.shape()[0]);
        if count == 0 {
            // Burn's ndarray divides by the number of rows in a product.
            return B::float_zeros(Shape::new([0, outer]), &rows.device(), rows.dtype().into());
        }
        // Not in one operation: a backend may add the bias inside its product, in another order.
        B::float_add(B::float_matmul(rows, weight), B::float_reshape(bias, Shape::new([1, outer])))
    }

    pub(crate) fn gradients<B: RowSums>(
        [rows, weight, _]: [FloatTensor<B>; 3],
        v: FloatTensor<B>,
        [of_rows, of_weight, of_bias]: [bool; 3],
    ) -> [Option<FloatTensor<B>>; 3] {
        [
            of_rows.then(|| B::float_matmul(v.clone(), B::float_transpose(weight))),
            of_weight.then(|| B::transposed(rows, v.clone())),
            of_bias.then(|| B::column_sums(v.clone())),
        ]
    }
}

impl Operation<3> for Affine {
    fn forward<B: HostBackend>(
        &self,
        [rows, weight, bias]: [FloatTensor<B>; 3],
        []: [IntTensor<B>; 0],
        _: bool,
    ) -> Output<B> {
        Output::of(Self::product::<B>(rows, weight, bias))
    }

    fn backward<B: HostBackend>(
        &self,
        mut state: State<B, 3, 0>,
        v: FloatTensor<B>,
        wanted: [bool; 3],
    ) -> [Option<FloatTensor<B>>; 3] {
        Self::gradients::<B>(state.inputs(), v, wanted)
    }
}

/// [`scaled`] as an operation.
#[derive(Clone, Debug)]
pub(crate) struct Scaled;

impl Scaled {
    pub(crate) fn multiples<B: Backend>(factors: FloatTensor<B>, rows: FloatTensor<B>) -> FloatTensor<B> {
        let (lines, [count, columns]) = (factors.shape()[0], rows.shape().dims());
        let factors = B::float_reshape(factors, Shape::new([lines, 1, 1]));
        B::float_mul(factors, B::float_reshape(rows, Shape::new([1, count, columns])))
    }

    pub(crate) fn gradients<B: RowSums>(
        [factors, rows]: [FloatTensor<B>; 2],
        v: FloatTensor<B>,
        [of_factors, of_rows]: [bool; 2],
    ) -> [Option<FloatTensor<B>>; 2] {
        let (lines, [count, columns]) = (factors.shape()[0], rows.shape().dims());
        let by_factors = of_factors.then(|| B::dots(v.clone(), rows));
        let by_rows = of_rows.then(|| {
            let factors = B::float_reshape(factors, Shape::new([lines, 1, 1]));
            let sum = B::float_sum_dim(B::float_mul(v, factors), 0);
            B::float_reshape(sum, Shape::new([count, columns]))
        });
        [by_factors, by_rows]
    }
}

impl Operation<2> for Scaled {
    fn forward<B: HostBackend>(
        &self,
        [factors, rows]: [FloatTensor<B>; 2],
        []: [IntTensor<B>; 0],
        _: bool,
    ) -> Output<B> {
        Output::of(Self::multiples::<B>(factors, rows))
    }

    fn backward<B: HostBackend>(
        &self,
        mut state: State<B, 2, 0>,
        v: FloatTensor<B>,
        wanted: [bool; 2],
    ) -> [Option<FloatTensor<B>>; 2] {
        Self::gradients::<B>(state.inputs(), v, wanted)
    }
}

/// [`transposed_product`] as a computation.
pub(crate) struct TransposedProduct;

impl Computation<2> for TransposedProduct {
    fn compute<B: HostBackend>(&self, [a, b]: [FloatTensor<B>; 2], []: [IntTensor<B>; 0]) -> Tensors<B> {
        Tensors::of_floats([B::transposed(a, b)])
    }
}
