//! The operations of [`crate::ops`] on Burn's CubeCL backends: tensors become device buffers of [`gs_kernels::cube`].
//! Everything computes in `f32`. Only the numbers of intersections and drawn tiles leave the device, where no room for
//! them was given.

mod dispatches;
mod images;
mod in_place;
mod products;
mod rows;
mod sparse_conv;
mod splats;

use burn::backend::Backend;
use burn::backend::tensor::IntTensor;
use burn::tensor::{DType, Shape};
use burn_cubecl::cubecl::client::Client;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use burn_cubecl::{CubeBackend, CubeDevice};
use gs_kernels::cube::buffer::Buffer;
use gs_kernels::cube::error::CubeError;
use gs_kernels::cube::intersect;

use crate::ops::operation::{Computation, ComputeOnCube, Kernels, OnCube, Operation, Output, State, Tensors};

/// The device of a kernel launch, with conversions between tensors and buffers.
struct Launch {
    client: Client,
    device: CubeDevice,
}

impl Launch {
    fn of(tensor: &CubeTensor) -> Self {
        Self { client: tensor.client.clone(), device: tensor.device.clone() }
    }

    /// # Panics
    /// When the tensor does not hold `f32`.
    fn floats(&self, tensor: CubeTensor) -> Buffer {
        assert!(tensor.dtype == DType::F32, "Gaussian splatting on a GPU computes in f32, not in {:?}", tensor.dtype);
        self.buffer(tensor)
    }

    /// # Panics
    /// When the tensor does not hold whole numbers of 32 bits.
    fn ints(&self, tensor: CubeTensor) -> Buffer {
        let fits = matches!(tensor.dtype, DType::I32 | DType::U32);
        assert!(fits, "lists of intersections hold i32, not {:?}", tensor.dtype);
        self.buffer(tensor)
    }

    fn buffer(&self, tensor: CubeTensor) -> Buffer {
        let tensor = into_contiguous(tensor);
        let len = tensor.meta.shape().num_elements();
        Buffer::from_handle(&self.client, tensor.handle, len)
    }

    /// A buffer of no value.
    fn none(&self, what: &'static str) -> Buffer {
        unwrap(Buffer::empty(&self.client, what, 0))
    }

    fn float_tensor<const D: usize>(&self, buffer: Buffer, shape: [usize; D]) -> CubeTensor {
        self.tensor(buffer, shape, DType::F32)
    }

    fn int_tensor(&self, buffer: Buffer) -> CubeTensor {
        let len = buffer.len();
        self.tensor(buffer, [len], DType::I32)
    }

    fn tensor<const D: usize>(&self, buffer: Buffer, shape: [usize; D], dtype: DType) -> CubeTensor {
        let handle = buffer.into_handle();
        CubeTensor::new_contiguous(self.client.clone(), self.device.clone(), Shape::new(shape), handle, dtype)
    }

    fn shaped(&self, buffer: Buffer, shape: Shape) -> CubeTensor {
        let handle = buffer.into_handle();
        CubeTensor::new_contiguous(self.client.clone(), self.device.clone(), shape, handle, DType::F32)
    }

    /// Tile offsets, ids of Gaussians, offsets of Gaussians, positions and places as the kernels take them.
    fn lists(&self, lists: [CubeTensor; 5]) -> intersect::Intersections {
        let [tile_offsets, gaussian_ids, gaussian_offsets, positions, places] = lists;
        let placed = places.meta.shape()[0];
        let tile_offsets = match placed {
            0 => tile_offsets,
            _ => joined::<CubeBackend>(tile_offsets, places),
        };
        intersect::Intersections {
            tile_offsets: self.ints(tile_offsets),
            placed,
            gaussian_ids: self.ints(gaussian_ids),
            gaussian_offsets: self.ints(gaussian_offsets),
            positions: self.ints(positions),
        }
    }
}

/// The concatenation of two lists.
fn joined<B: Backend>(first: IntTensor<B>, second: IntTensor<B>) -> IntTensor<B> {
    B::int_cat(vec![first, second], 0)
}

/// Panics on a [`CubeError`]: Burn's operations return tensors, not results.
fn unwrap<T>(result: Result<T, CubeError>) -> T {
    result.unwrap_or_else(|error| panic!("{error}"))
}

impl Kernels for CubeBackend {
    fn forward<O: Operation<N, M>, const N: usize, const M: usize>(
        operation: &O,
        inputs: [CubeTensor; N],
        lists: [CubeTensor; M],
        tracked: bool,
    ) -> Output<Self> {
        OnCube::forward(operation, inputs, lists, tracked)
    }

    fn backward<O: Operation<N, M>, const N: usize, const M: usize>(
        operation: &O,
        state: State<Self, N, M>,
        v: CubeTensor,
        wanted: [bool; N],
    ) -> [Option<CubeTensor>; N] {
        OnCube::backward(operation, state, v, wanted)
    }

    fn compute<C: Computation<N, M>, const N: usize, const M: usize>(
        computation: &C,
        inputs: [CubeTensor; N],
        lists: [CubeTensor; M],
    ) -> Tensors<Self> {
        ComputeOnCube::compute(computation, inputs, lists)
    }
}

/// The tensor, contiguous and alone in its memory, so that it may be written: memory that is shared is copied.
fn owned(tensor: CubeTensor) -> CubeTensor {
    let tensor = into_contiguous(tensor);
    if tensor.can_mut() { tensor } else { tensor.copy() }
}
