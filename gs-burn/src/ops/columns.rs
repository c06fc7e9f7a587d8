//! Columns of a packed `[N, 8]` tensor of [`gs_kernels::rows::ProjectedRow`]s, for tensor operations.

use burn::tensor::Tensor;

const MEAN: usize = 0;
const CONIC: usize = 2;
const DEPTH: usize = gs_kernels::rows::DEPTH;
const COMPENSATION: usize = 6;
const RADIUS: usize = 7;

/// Projected means `[N, 2]`, pixels.
pub fn mean(projected: Tensor<2>) -> Tensor<2> {
    projected.narrow(1, MEAN, 2)
}

/// Conics `[N, 3]` as `[d1, l, d2]`.
pub fn conic(projected: Tensor<2>) -> Tensor<2> {
    projected.narrow(1, CONIC, 3)
}

/// Camera depths `[N, 1]`.
pub fn depth(projected: Tensor<2>) -> Tensor<2> {
    projected.narrow(1, DEPTH, 1)
}

/// Opacity factors `[N, 1]`.
pub fn compensation(projected: Tensor<2>) -> Tensor<2> {
    projected.narrow(1, COMPENSATION, 1)
}

/// Bounding radii `[N, 1]`, pixels; 0 when culled.
pub fn radius(projected: Tensor<2>) -> Tensor<2> {
    projected.narrow(1, RADIUS, 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gs_kernels::rows::ProjectedRow;

    #[test]
    fn columns_are_those_of_the_row() {
        let row =
            ProjectedRow { mean: [1.0_f64, 2.0], conic: [3.0, 4.0, 5.0], depth: 6.0, compensation: 7.0, radius: 8.0 };
        let packed = row.pack();
        assert_eq!(packed[MEAN..MEAN + 2], row.mean);
        assert_eq!(packed[CONIC..CONIC + 3], row.conic);
        assert_eq!((packed[DEPTH], packed[COMPENSATION], packed[RADIUS]), (6.0, 7.0, 8.0));
    }
}
