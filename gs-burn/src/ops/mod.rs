//! The differentiable operations, one concept per file, each usable alone.
//!
//! Every op has the same parts:
//!
//! - a function on Burn tensors (`project`, `rasterize`, ...), which checks shapes at the door;
//! - a `..._reference` in plain Burn tensor operations, differentiable by Burn itself, slow and obvious: it defines
//!   what is correct;
//! - a struct of its settings with the raw forward and backward, on primitives without gradients. The CPU backends
//!   (Flex, NdArray) share one body over slices; that of CubeCL's backends is in `cube`.
//!
//! The way through Burn, its dispatch and its graph of gradients, is written once for all of them, in `operation`. **A
//! new backend is a body for each struct and nothing else.**
//!
//! Counts may be zero: an empty scene has `[0, ...]` tensors, and kernels must return what the shapes say.

pub mod adam;
pub mod bilinear;
pub mod channels;
pub mod exposure;
pub mod instants;
pub mod intersect;
pub mod noise;
pub mod opacity;
pub mod products;
pub mod projection;
pub mod rasterize;
pub mod rows;
pub mod segments;
pub mod sh;
pub mod silu;
pub mod sparse_conv;
pub mod ssim;
pub mod statistics;
pub mod sum;

pub(crate) mod columns;
pub(crate) mod operation;
mod pixels;

use burn::tensor::{DType, Device, Int, Tensor, TensorData};

/// Panics unless both tensors hold the same float type; kernels never convert.
fn assert_same_dtype<const D1: usize, const D2: usize>(name: &str, tensor: &Tensor<D1>, of: &str, like: &Tensor<D2>) {
    assert!(
        tensor.dtype() == like.dtype(),
        "{name} must have the float type of {of}, {:?}; it has {:?}",
        like.dtype(),
        tensor.dtype()
    );
}

/// Whole numbers from the host, without gradient tracking.
fn index_tensor(values: Vec<i32>, device: &Device) -> Tensor<1, Int> {
    let len = values.len();
    Tensor::from_data(TensorData::new(values, [len]), (device, DType::I32)).inner()
}
