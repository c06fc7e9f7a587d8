//! The kernel traits of [`crate::ops`] for Burn's CubeCL backends: tensors become device buffers of [`gs_kernels::cube`].
//! Everything computes in `f32`. Only the numbers of intersections and drawn tiles leave the device, where no room for them was given.

mod dispatches;
mod images;
mod in_place;
mod products;
mod sh;
mod sparse_conv;

use burn::backend::Backend;
use burn::backend::tensor::IntTensor;
use burn::tensor::{DType, Shape};
use burn_cubecl::cubecl::client::Client;
use burn_cubecl::kernel::into_contiguous;
use burn_cubecl::tensor::CubeTensor;
use burn_cubecl::{CubeBackend, CubeDevice};
use gs_kernels::config::{Activation, ProjectionConfig};
use gs_kernels::cube::buffer::Buffer;
use gs_kernels::cube::error::CubeError;
use gs_kernels::cube::{intersect, opacity, projection, rasterize, rows_of, sum};
use gs_kernels::rows::{PROJECTED, SCREEN};

use crate::ops::instants::{FoundInstants, InstantsKernels};
use crate::ops::intersect::{FoundIntersections, IntersectKernels, IntersectionLists, Room};
use crate::ops::opacity::OpacityKernels;
use crate::ops::projection::{ProjectionGradients, ProjectionKernels};
use crate::ops::rasterize::{RasterizeForward, RasterizeGradients, RasterizeInputs, RasterizeKernels, RasterizeSaved};
use crate::ops::rows::{RowsKernels, columns, with_rows};
use crate::ops::sum::SumKernels;

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

    fn lists(&self, lists: IntersectionLists<CubeBackend>) -> intersect::Intersections {
        let placed = lists.places.meta.shape()[0];
        let tile_offsets = match placed {
            0 => lists.tile_offsets,
            _ => joined::<CubeBackend>(lists.tile_offsets, lists.places),
        };
        intersect::Intersections {
            tile_offsets: self.ints(tile_offsets),
            placed,
            gaussian_ids: self.ints(lists.gaussian_ids),
            gaussian_offsets: self.ints(lists.gaussian_offsets),
            positions: self.ints(lists.positions),
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

impl ProjectionKernels for CubeBackend {
    fn projection_forward(
        means: CubeTensor,
        quats: CubeTensor,
        log_scales: CubeTensor,
        viewmat: CubeTensor,
        config: &ProjectionConfig,
    ) -> CubeTensor {
        let (launch, count) = (Launch::of(&means), means.meta.shape()[0]);
        let [means, quats, log_scales, viewmat] = [means, quats, log_scales, viewmat].map(|t| launch.floats(t));
        let rows = projection::forward(&launch.client, &means, &quats, &log_scales, &viewmat, config);
        launch.float_tensor(unwrap(rows), [count, PROJECTED])
    }

    fn projection_backward(
        means: CubeTensor,
        quats: CubeTensor,
        log_scales: CubeTensor,
        viewmat: CubeTensor,
        config: &ProjectionConfig,
        projected: CubeTensor,
        v_projected: CubeTensor,
        of_pose: bool,
    ) -> ProjectionGradients<Self> {
        let (launch, count) = (Launch::of(&means), means.meta.shape()[0]);
        let [means, quats, log_scales, viewmat, projected, v_projected] =
            [means, quats, log_scales, viewmat, projected, v_projected].map(|t| launch.floats(t));
        let gradients = unwrap(projection::backward(
            &launch.client,
            &means,
            &quats,
            &log_scales,
            &viewmat,
            config,
            &projected,
            &v_projected,
            of_pose,
        ));
        ProjectionGradients {
            means: launch.float_tensor(gradients.means, [count, 3]),
            quats: launch.float_tensor(gradients.quats, [count, 4]),
            log_scales: launch.float_tensor(gradients.log_scales, [count, 3]),
            viewmat: gradients.viewmat.map(|pose| launch.float_tensor(pose, [4, 4])),
        }
    }
}

impl IntersectKernels for CubeBackend {
    fn intersect_forward(
        projected: CubeTensor,
        opacities: CubeTensor,
        features: CubeTensor,
        width: u32,
        height: u32,
        room: Option<usize>,
    ) -> FoundIntersections<Self> {
        let (launch, channels) = (Launch::of(&projected), features.meta.shape()[1]);
        let [projected, opacities, features] = [projected, opacities, features].map(|t| launch.floats(t));
        let size = [width, height];
        let found = intersect::intersect(&launch.client, &projected, &opacities, &features, size, channels, room);
        let intersect::Found { lists, words } = unwrap(found);
        let words = words.unwrap_or_else(|| launch.none("no number of pairs"));
        let number_len = words.len();
        FoundIntersections {
            tile_offsets: launch.int_tensor(lists.tile_offsets),
            gaussian_ids: launch.int_tensor(lists.gaussian_ids),
            gaussian_offsets: launch.int_tensor(lists.gaussian_offsets),
            positions: launch.int_tensor(lists.positions),
            words: launch.float_tensor(words, [number_len]),
        }
    }
}

impl InstantsKernels for CubeBackend {
    fn instants_forward(
        projected: CubeTensor,
        opacities: CubeTensor,
        features: CubeTensor,
        size: [u32; 2],
        scene: usize,
        moving: CubeTensor,
        room: Option<Room>,
    ) -> FoundInstants<Self> {
        let (launch, channels) = (Launch::of(&projected), features.meta.shape()[1]);
        let [projected, opacities, features] = &[projected, opacities, features].map(|t| launch.floats(t));
        let moving = &launch.ints(moving);
        let rows = intersect::InstantRows { projected, opacities, features, scene, moving };
        let found = unwrap(intersect::intersect_instants(&launch.client, rows, size, channels, room));
        let words = match found.words {
            Some(words) => words,
            None => ["no number of pairs", "no number of tiles"].map(|what| launch.none(what)),
        };
        let [pair_words, tile_words] = words.map(|words| {
            let len = words.len();
            launch.float_tensor(words, [len])
        });
        FoundInstants {
            tile_offsets: launch.int_tensor(found.tile_offsets),
            gaussian_ids: launch.int_tensor(found.gaussian_ids),
            gaussian_offsets: launch.int_tensor(found.gaussian_offsets),
            positions: launch.int_tensor(found.positions),
            places: launch.int_tensor(found.places),
            shares: launch.int_tensor(found.shares),
            pair_words,
            tile_words,
        }
    }
}

impl RasterizeKernels for CubeBackend {
    fn rasterize_forward(inputs: RasterizeInputs<Self>, save: bool) -> RasterizeForward<Self> {
        let shape = inputs.output_shape();
        let (launch, config) = (Launch::of(&inputs.projected), inputs.config);
        let rendered =
            Blended::of(&launch, inputs).with(|inputs| rasterize::forward(&launch.client, &config, inputs, save));
        let rasterize::Rendered { output, saved } = unwrap(rendered);
        RasterizeForward {
            output: launch.float_tensor(output, shape),
            saved: saved.map(|saved| {
                let len = saved.attributes.len();
                let rows = launch.float_tensor(saved.attributes, [len]);
                RasterizeSaved { rows, words: launch.int_tensor(saved.pixels) }
            }),
        }
    }

    fn rasterize_backward(
        inputs: RasterizeInputs<Self>,
        saved: Option<RasterizeSaved<Self>>,
        v_output: CubeTensor,
        of_background: bool,
    ) -> RasterizeGradients<Self> {
        let (launch, config) = (Launch::of(&inputs.projected), inputs.config);
        let count = inputs.projected.meta.shape()[0];
        let saved = saved.expect("a tracked forward pass saves its state");
        let saved = rasterize::Saved { attributes: launch.floats(saved.rows), pixels: launch.ints(saved.words) };
        let v_output = launch.floats(v_output);
        let bytes = dispatches::pair_bytes(&launch.device);
        let gradients = Blended::of(&launch, inputs).with(|inputs| {
            rasterize::backward_within(&launch.client, &config, inputs, &saved, &v_output, of_background, bytes)
        });
        let gradients = unwrap(gradients);
        RasterizeGradients {
            projected: launch.float_tensor(gradients.projected, [count, PROJECTED]),
            opacities: launch.float_tensor(gradients.opacities, [count]),
            features: launch.float_tensor(gradients.features, [count, config.channels]),
            background: gradients.background.map(|sums| launch.float_tensor(sums, [config.channels])),
            screen: launch.float_tensor(gradients.screen, [count, SCREEN]),
        }
    }
}

/// The inputs of a rasterization as buffers.
struct Blended {
    floats: [Buffer; 4],
    lists: intersect::Intersections,
}

impl Blended {
    fn of(launch: &Launch, inputs: RasterizeInputs<CubeBackend>) -> Self {
        let RasterizeInputs { projected, opacities, features, background, intersections, .. } = inputs;
        let floats = [projected, opacities, features, background].map(|tensor| launch.floats(tensor));
        Self { floats, lists: launch.lists(intersections) }
    }

    fn with<T>(&self, task: impl FnOnce(&rasterize::Inputs) -> T) -> T {
        let [projected, opacities, features, background] = &self.floats;
        task(&rasterize::Inputs { projected, opacities, features, background, lists: &self.lists })
    }
}

impl OpacityKernels for CubeBackend {
    fn opacity_forward(logits: CubeTensor) -> CubeTensor {
        let (launch, count) = (Launch::of(&logits), logits.meta.shape()[0]);
        let opacities = opacity::forward(&launch.client, &launch.floats(logits));
        launch.float_tensor(unwrap(opacities), [count])
    }

    fn opacity_backward(logits: CubeTensor, v: CubeTensor) -> CubeTensor {
        let (launch, count) = (Launch::of(&logits), logits.meta.shape()[0]);
        let v_logits = opacity::backward(&launch.client, &launch.floats(logits), &launch.floats(v));
        launch.float_tensor(unwrap(v_logits), [count])
    }
}

impl SumKernels for CubeBackend {
    fn sum_forward(tensor: CubeTensor) -> CubeTensor {
        let launch = Launch::of(&tensor);
        launch.float_tensor(unwrap(sum::sum(&launch.client, &launch.floats(tensor))), [1])
    }

    fn activated_sum_forward(tensor: CubeTensor, activation: Activation, factor: f64) -> CubeTensor {
        let launch = Launch::of(&tensor);
        let total = sum::activated(&launch.client, &launch.floats(tensor), activation, factor as f32);
        launch.float_tensor(unwrap(total), [1])
    }

    fn activated_sum_backward(tensor: CubeTensor, v: CubeTensor, activation: Activation, factor: f64) -> CubeTensor {
        let (launch, shape) = (Launch::of(&tensor), tensor.meta.shape().clone());
        let (tensor, v) = (launch.floats(tensor), launch.floats(v));
        let gradient = sum::activated_backward(&launch.client, &tensor, &v, activation, factor as f32);
        launch.shaped(unwrap(gradient), shape)
    }

    fn finite_mark(mark: CubeTensor, tensor: CubeTensor) -> CubeTensor {
        let launch = Launch::of(&tensor);
        let mark = owned(mark);
        sum::mark_not_finite(&launch.client, &launch.floats(tensor), &launch.floats(mark.clone()));
        mark
    }

    fn largest_of(tensor: CubeTensor) -> CubeTensor {
        let launch = Launch::of(&tensor);
        launch.float_tensor(unwrap(sum::largest(&launch.client, &launch.floats(tensor))), [1])
    }
}

impl RowsKernels for CubeBackend {
    fn take(table: CubeTensor, rows: CubeTensor) -> CubeTensor {
        let launch = Launch::of(&table);
        let columns = columns(table.meta.shape());
        let shape = with_rows(table.meta.shape().clone(), rows.meta.shape()[0]);
        let taken = rows_of::take(&launch.client, &launch.floats(table), columns, &launch.ints(rows));
        launch.shaped(unwrap(taken), shape)
    }

    fn add(table: CubeTensor, rows: CubeTensor, more: CubeTensor) -> CubeTensor {
        let (launch, table) = (Launch::of(&table), owned(table));
        let columns = columns(table.meta.shape());
        let [b_table, more] = [table.clone(), more].map(|tensor| launch.floats(tensor));
        rows_of::add(&launch.client, &b_table, columns, &launch.ints(rows), &more);
        table
    }

    fn put(shape: Shape, rows: CubeTensor, more: CubeTensor) -> CubeTensor {
        let launch = Launch::of(&more);
        let table = unwrap(rows_of::zeros(&launch.client, "rows put into zeros", shape.num_elements()));
        rows_of::add(&launch.client, &table, columns(&shape), &launch.ints(rows), &launch.floats(more));
        launch.shaped(table, shape)
    }
}

/// The tensor, contiguous and alone in its memory, so that it may be written: memory that is shared is copied.
fn owned(tensor: CubeTensor) -> CubeTensor {
    let tensor = into_contiguous(tensor);
    if tensor.can_mut() { tensor } else { tensor.copy() }
}
