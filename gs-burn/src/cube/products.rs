//! The layers of networks on a GPU: products with sums over many rows, and an activation.

use burn::backend::ops::{ActivationOps, FloatTensorOps};
use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use gs_kernels::cube::products;

use super::{Launch, unwrap};
use crate::ops::operation::{ComputeOnCube, OnCube, Output, State, Tensors};
use crate::ops::products::{Affine, RowSums, Scaled, TransposedProduct};
use crate::ops::silu::Silu;

impl RowSums for CubeBackend {
    fn transposed(a: CubeTensor, b: CubeTensor) -> CubeTensor {
        let (launch, inner, outer) = (Launch::of(&a), a.meta.shape()[1], b.meta.shape()[1]);
        let [a, b] = [a, b].map(|t| launch.floats(t));
        launch.float_tensor(unwrap(products::transposed(&launch.client, &a, &b, inner, outer)), [inner, outer])
    }

    fn column_sums(b: CubeTensor) -> CubeTensor {
        let (launch, outer) = (Launch::of(&b), b.meta.shape()[1]);
        let b = launch.floats(b);
        launch.float_tensor(unwrap(products::column_sums(&launch.client, &b, outer)), [outer])
    }

    fn dots(v: CubeTensor, rows: CubeTensor) -> CubeTensor {
        let (launch, lines) = (Launch::of(&v), v.meta.shape()[0]);
        let [v, rows] = [v, rows].map(|t| launch.floats(t));
        launch.float_tensor(unwrap(products::dots(&launch.client, &v, &rows, lines)), [lines])
    }
}

impl OnCube<3, 0> for Affine {
    fn forward(&self, [rows, weight, bias]: [CubeTensor; 3], []: [CubeTensor; 0], _: bool) -> Output<CubeBackend> {
        Output::of(Self::product::<CubeBackend>(rows, weight, bias))
    }

    fn backward(
        &self,
        mut state: State<CubeBackend, 3, 0>,
        v: CubeTensor,
        wanted: [bool; 3],
    ) -> [Option<CubeTensor>; 3] {
        Self::gradients::<CubeBackend>(state.inputs(), v, wanted)
    }
}

/// By the backend's own operations, a pass for each.
impl OnCube<1, 0> for Silu {
    fn forward(&self, [x]: [CubeTensor; 1], []: [CubeTensor; 0], _: bool) -> Output<CubeBackend> {
        Output::of(CubeBackend::float_mul(x.clone(), CubeBackend::sigmoid(x)))
    }

    fn backward(&self, mut state: State<CubeBackend, 1, 0>, v: CubeTensor, _: [bool; 1]) -> [Option<CubeTensor>; 1] {
        let [x] = state.inputs();
        let s = CubeBackend::sigmoid(x.clone());
        let less = CubeBackend::float_add_scalar(CubeBackend::float_neg(s.clone()), 1.0.into());
        let slope = CubeBackend::float_add_scalar(CubeBackend::float_mul(x, less), 1.0.into());
        [Some(CubeBackend::float_mul(v, CubeBackend::float_mul(s, slope)))]
    }
}

impl OnCube<2, 0> for Scaled {
    fn forward(&self, [factors, rows]: [CubeTensor; 2], []: [CubeTensor; 0], _: bool) -> Output<CubeBackend> {
        Output::of(Self::multiples::<CubeBackend>(factors, rows))
    }

    fn backward(
        &self,
        mut state: State<CubeBackend, 2, 0>,
        v: CubeTensor,
        wanted: [bool; 2],
    ) -> [Option<CubeTensor>; 2] {
        Self::gradients::<CubeBackend>(state.inputs(), v, wanted)
    }
}

impl ComputeOnCube<2, 0> for TransposedProduct {
    fn compute(&self, [a, b]: [CubeTensor; 2], []: [CubeTensor; 0]) -> Tensors<CubeBackend> {
        Tensors::of_floats([CubeBackend::transposed(a, b)])
    }
}
