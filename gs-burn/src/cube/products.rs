//! Products with sums over many rows on a GPU.

use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use gs_kernels::cube::products;

use super::{Launch, unwrap};
use crate::ops::products::ProductKernels;

impl ProductKernels for CubeBackend {
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
