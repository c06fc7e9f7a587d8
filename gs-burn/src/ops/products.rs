//! Products whose gradients are sums over many rows.
//!
//! On a GPU, Burn gives such a sum to one unit per result: the gradient of a bias over all pixels of an image is a loop of a million
//! additions in 32 units. Here the rows are cut into groups, in one order. On a CPU the operations are Burn's own.

use burn::backend::tensor::FloatTensor;
use burn::backend::{Backend, Dispatch, TensorMetadata, backend_extension};
use burn::tensor::{Shape, Tensor, assert_shape};

use super::gradient::{self, Autodiff, Backward, CheckpointStrategy, Checkpointer, Gradients, Ops, OpsKind};
use crate::slices::HostBackend;

/// `rows weight + bias`, `[R, out]`, of `rows` `[R, in]`, `weight` `[in, out]` and `bias` `[out]`: a layer of a network. Differentiable
/// by all three. On CUDA the product may be computed in TF32.
///
/// # Panics
/// When shapes disagree.
pub fn affine(rows: Tensor<2>, weight: Tensor<2>, bias: Tensor<1>) -> Tensor<2> {
    let ([_, inner], [_, outer]) = (rows.dims(), weight.dims());
    assert_shape!(weight, [inner, outer]);
    assert_shape!(bias, [outer]);
    Tensor::from_dispatch(Dispatch::affine(rows.into_dispatch(), weight.into_dispatch(), bias.into_dispatch()))
}

/// `factors[s] rows[r, c]`, `[S, R, C]`, of `factors` `[S]` and `rows` `[R, C]`. Differentiable by both.
pub fn scaled(factors: Tensor<1>, rows: Tensor<2>) -> Tensor<3> {
    Tensor::from_dispatch(Dispatch::scaled(factors.into_dispatch(), rows.into_dispatch()))
}

/// `a^T b`, `[I, O]`, of `a` `[R, I]` and `b` `[R, O]`, with full precision. Gradient tracking is dropped.
///
/// # Panics
/// When the numbers of rows disagree.
pub fn transposed_product(a: Tensor<2>, b: Tensor<2>) -> Tensor<2> {
    let ([rows, _], [_, outer]) = (a.dims(), b.dims());
    assert_shape!(b, [rows, outer]);
    Tensor::from_dispatch(Dispatch::transposed_product(a.inner().into_dispatch(), b.inner().into_dispatch()))
}

/// Burn's dispatch for [`affine`] and [`scaled`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube"),
    Autodiff
)]
pub trait ProductOps: Backend {
    /// See [`affine`].
    fn affine(rows: FloatTensor<Self>, weight: FloatTensor<Self>, bias: FloatTensor<Self>) -> FloatTensor<Self>;

    /// See [`scaled`].
    fn scaled(factors: FloatTensor<Self>, rows: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// Burn's dispatch for [`transposed_product`].
#[backend_extension(
    Flex: cfg(feature = "flex"),
    NdArray: cfg(feature = "ndarray"),
    Cube: cfg(feature = "cube")
)]
pub trait TransposedOps: Backend {
    /// See [`transposed_product`].
    fn transposed_product(a: FloatTensor<Self>, b: FloatTensor<Self>) -> FloatTensor<Self>;
}

/// The sums over rows on a backend's primitives, without gradient tracking. The default bodies are plain tensor operations.
pub trait ProductKernels: Backend {
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

impl<B: HostBackend> ProductKernels for B {}

fn product<B: Backend>(rows: FloatTensor<B>, weight: FloatTensor<B>, bias: FloatTensor<B>) -> FloatTensor<B> {
    let (count, outer) = (rows.shape()[0], bias.shape()[0]);
    if count == 0 {
        // Burn's ndarray divides by the number of rows in a product.
        return B::float_zeros(Shape::new([0, outer]), &rows.device(), rows.dtype().into());
    }
    // Not in one operation: a backend may add the bias inside its product, in another order.
    B::float_add(B::float_matmul(rows, weight), B::float_reshape(bias, Shape::new([1, outer])))
}

fn multiples<B: Backend>(factors: FloatTensor<B>, rows: FloatTensor<B>) -> FloatTensor<B> {
    let (lines, [count, columns]) = (factors.shape()[0], rows.shape().dims());
    let factors = B::float_reshape(factors, Shape::new([lines, 1, 1]));
    B::float_mul(factors, B::float_reshape(rows, Shape::new([1, count, columns])))
}

impl<B: ProductKernels> ProductOps for B {
    fn affine(rows: FloatTensor<B>, weight: FloatTensor<B>, bias: FloatTensor<B>) -> FloatTensor<B> {
        product::<B>(rows, weight, bias)
    }

    fn scaled(factors: FloatTensor<B>, rows: FloatTensor<B>) -> FloatTensor<B> {
        multiples::<B>(factors, rows)
    }
}

impl<B: ProductKernels> TransposedOps for B {
    fn transposed_product(a: FloatTensor<B>, b: FloatTensor<B>) -> FloatTensor<B> {
        B::transposed(a, b)
    }
}

/// State saved for the backward pass of [`affine`].
#[derive(Clone, Debug)]
struct AffineState<B: Backend> {
    rows: FloatTensor<B>,
    weight: FloatTensor<B>,
}

#[derive(Debug)]
struct AffineBackward;

impl<B: ProductKernels> Backward<B, 3> for AffineBackward {
    type State = AffineState<B>;

    fn backward(self, ops: Ops<Self::State, 3>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let v = grads.consume::<B>(&ops.node);
        let AffineState { rows, weight } = ops.state;
        let [of_rows, of_weight, of_bias] = ops.parents.map(|node| node.map(|node| node.id));
        if of_rows.is_some() {
            let v_rows = B::float_matmul(v.clone(), B::float_transpose(weight));
            gradient::register::<B, 1>(grads, [of_rows], [v_rows]);
        }
        if of_weight.is_some() {
            gradient::register::<B, 1>(grads, [of_weight], [B::transposed(rows, v.clone())]);
        }
        if of_bias.is_some() {
            gradient::register::<B, 1>(grads, [of_bias], [B::column_sums(v)]);
        }
    }
}

/// State saved for the backward pass of [`scaled`].
#[derive(Clone, Debug)]
struct ScaledState<B: Backend> {
    factors: FloatTensor<B>,
    rows: FloatTensor<B>,
}

#[derive(Debug)]
struct ScaledBackward;

impl<B: ProductKernels> Backward<B, 2> for ScaledBackward {
    type State = ScaledState<B>;

    fn backward(self, ops: Ops<Self::State, 2>, grads: &mut Gradients, _checkpointer: &mut Checkpointer) {
        let v = grads.consume::<B>(&ops.node);
        let ScaledState { factors, rows } = ops.state;
        let [of_factors, of_rows] = ops.parents.map(|node| node.map(|node| node.id));
        let (lines, [count, columns]) = (factors.shape()[0], rows.shape().dims());
        if of_factors.is_some() {
            gradient::register::<B, 1>(grads, [of_factors], [B::dots(v.clone(), rows)]);
        }
        if of_rows.is_some() {
            let factors = B::float_reshape(factors, Shape::new([lines, 1, 1]));
            let sum = B::float_sum_dim(B::float_mul(v, factors), 0);
            gradient::register::<B, 1>(grads, [of_rows], [B::float_reshape(sum, Shape::new([count, columns]))]);
        }
    }
}

impl<B: ProductKernels, C: CheckpointStrategy> ProductOps for Autodiff<B, C> {
    fn affine(rows: FloatTensor<Self>, weight: FloatTensor<Self>, bias: FloatTensor<Self>) -> FloatTensor<Self> {
        let (rows, rows_node) = rows.into_parts();
        let (weight, weight_node) = weight.into_parts();
        let (bias, bias_node) = bias.into_parts();
        let output = product::<B>(rows.clone(), weight.clone(), bias);
        match AffineBackward.prepare::<C>([rows_node, weight_node, bias_node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(AffineState { rows, weight }, output),
            OpsKind::UnTracked(prep) => prep.finish(output),
        }
    }

    fn scaled(factors: FloatTensor<Self>, rows: FloatTensor<Self>) -> FloatTensor<Self> {
        let (factors, factors_node) = factors.into_parts();
        let (rows, rows_node) = rows.into_parts();
        let output = multiples::<B>(factors.clone(), rows.clone());
        match ScaledBackward.prepare::<C>([factors_node, rows_node]).compute_bound().stateful() {
            OpsKind::Tracked(prep) => prep.finish(ScaledState { factors, rows }, output),
            OpsKind::UnTracked(prep) => prep.finish(output),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{GradientOf, Random, assert_close, assert_same_gradients, gradient_of};

    #[test]
    fn a_layer_is_burns_with_its_gradients() {
        let rows = Random(1).tensor([70, 5], -1.0, 1.0).require_grad();
        let weight = Random(2).tensor([5, 4], -1.0, 1.0).require_grad();
        let bias = Random(3).tensor([4], -1.0, 1.0).require_grad();
        let expected = rows.clone().matmul(weight.clone()) + bias.clone().unsqueeze::<2>();
        let leaves: [(&str, &GradientOf); 3] =
            [("rows", &gradient_of(&rows)), ("weight", &gradient_of(&weight)), ("bias", &gradient_of(&bias))];
        assert_same_gradients(affine(rows.clone(), weight.clone(), bias.clone()), expected, &leaves);
    }

    #[test]
    fn multiples_are_burns_with_their_gradients() {
        let factors = Random(4).tensor([3], -1.0, 1.0).require_grad();
        let rows = Random(5).tensor([40, 2], -1.0, 1.0).require_grad();
        let expected = factors.clone().reshape([3, 1, 1]) * rows.clone().reshape([1, 40, 2]);
        let leaves: [(&str, &GradientOf); 2] = [("factors", &gradient_of(&factors)), ("rows", &gradient_of(&rows))];
        assert_same_gradients(scaled(factors.clone(), rows.clone()), expected, &leaves);
    }

    #[test]
    fn a_transposed_product_is_burns() {
        let (a, b) = (Random(6).tensor([90, 3], -1.0, 1.0), Random(7).tensor([90, 4], -1.0, 1.0));
        assert_close("product", &transposed_product(a.clone(), b.clone()), &a.transpose().matmul(b).inner(), 1e-12);
    }
}
