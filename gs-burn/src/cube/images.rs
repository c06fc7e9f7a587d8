//! Operations on images on a GPU: parts, lookups, means over an exposure, the photometric terms.

use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use gs_kernels::cube::{bilinear, channels, exposure, ssim};

use super::{Launch, unwrap};
use crate::ops::bilinear::Lookup;
use crate::ops::channels::Channels;
use crate::ops::exposure::Average;
use crate::ops::operation::{OnCube, Output, State, Tensors};
use crate::ops::ssim::Comparison;

impl OnCube<2, 0> for Lookup {
    fn forward(&self, [image, positions]: [CubeTensor; 2], []: [CubeTensor; 0], _: bool) -> Output<CubeBackend> {
        let (launch, count) = (Launch::of(&image), positions.meta.shape()[0]);
        let [height, width, channels] = image.meta.shape().dims();
        let [image, positions] = [image, positions].map(|t| launch.floats(t));
        let values = bilinear::forward(&launch.client, &image, [height, width], channels, &positions);
        Output::of(launch.float_tensor(unwrap(values), [count, channels]))
    }

    fn backward(
        &self,
        mut state: State<CubeBackend, 2, 0>,
        v: CubeTensor,
        [of_image, of_positions]: [bool; 2],
    ) -> [Option<CubeTensor>; 2] {
        let [image, positions] = state.inputs();
        let (launch, count) = (Launch::of(&v), positions.meta.shape()[0]);
        let [height, width, channels] = image.meta.shape().dims();
        let ([image, positions, v], size) = ([image, positions, v].map(|t| launch.floats(t)), [height, width]);
        let by_image = || unwrap(bilinear::by_image(&launch.client, size, channels, &positions, &v));
        let by_positions = || unwrap(bilinear::by_positions(&launch.client, &image, size, channels, &positions, &v));
        [
            of_image.then(|| launch.float_tensor(by_image(), [height, width, channels])),
            of_positions.then(|| launch.float_tensor(by_positions(), [count, 2])),
        ]
    }
}

impl OnCube<1, 0> for Channels {
    fn forward(&self, [image]: [CubeTensor; 1], []: [CubeTensor; 0], _: bool) -> Output<CubeBackend> {
        let (launch, [height, width, _]) = (Launch::of(&image), image.meta.shape().dims());
        let part = channels::forward(&launch.client, &launch.floats(image), self.total, self.first, self.count);
        Output::of(launch.float_tensor(unwrap(part), [height, width, self.count]))
    }

    fn backward(&self, _: State<CubeBackend, 1, 0>, v: CubeTensor, _: [bool; 1]) -> [Option<CubeTensor>; 1] {
        let (launch, [height, width, _]) = (Launch::of(&v), v.meta.shape().dims());
        let whole = channels::backward(&launch.client, &launch.floats(v), self.total, self.first, self.count);
        [Some(launch.float_tensor(unwrap(whole), [height, width, self.total]))]
    }
}

impl OnCube<1, 1> for Average {
    fn forward(&self, [tiles]: [CubeTensor; 1], [shares]: [CubeTensor; 1], _: bool) -> Output<CubeBackend> {
        let (launch, config) = (Launch::of(&tiles), &self.config);
        let shares = launch.ints(shares);
        let image = exposure::average(&launch.client, config, &shares, self.instants, &launch.floats(tiles));
        let shape = [config.height as usize, config.width as usize, config.channels];
        Output::of(launch.float_tensor(unwrap(image), shape))
    }

    fn backward(&self, mut state: State<CubeBackend, 1, 1>, v: CubeTensor, _: [bool; 1]) -> [Option<CubeTensor>; 1] {
        let ([tiles], [shares]) = (state.inputs(), state.lists);
        let (launch, shape) = (Launch::of(&tiles), tiles.meta.shape().clone());
        let (shares, [tiles, v]) = (launch.ints(shares), [tiles, v].map(|t| launch.floats(t)));
        let v_tiles = exposure::average_backward(&launch.client, &self.config, &shares, self.instants, &tiles, &v);
        [Some(launch.shaped(unwrap(v_tiles), shape))]
    }
}

/// Both terms `[2]`, and the maps for the backward pass, each `[H, W, C]`.
fn compare(image: CubeTensor, target: CubeTensor) -> (CubeTensor, [CubeTensor; 3]) {
    let launch = Launch::of(&image);
    let [height, width, channels] = image.meta.shape().dims();
    let [image, target] = [image, target].map(|t| launch.floats(t));
    let result = unwrap(ssim::forward(&launch.client, &image, &target, width, height, channels));
    let maps = result.saved.map(|map| launch.float_tensor(map, [height, width, channels]));
    (launch.float_tensor(result.means, [2]), maps)
}

/// Gradient with respect to `image` `[H, W, C]`, from `v_terms` `[2]`.
fn by_image(image: CubeTensor, target: CubeTensor, saved: [CubeTensor; 3], v_terms: CubeTensor) -> CubeTensor {
    let launch = Launch::of(&image);
    let [height, width, channels] = image.meta.shape().dims();
    let [image, target, v_terms] = [image, target, v_terms].map(|t| launch.floats(t));
    let saved = saved.map(|t| launch.floats(t));
    let v_image = ssim::backward(&launch.client, &image, &target, &saved, width, height, channels, &v_terms);
    launch.float_tensor(unwrap(v_image), [height, width, channels])
}

impl OnCube<2, 0> for Comparison {
    fn forward(&self, [image, target]: [CubeTensor; 2], []: [CubeTensor; 0], _: bool) -> Output<CubeBackend> {
        let launch = Launch::of(&image);
        let (terms, maps) = compare(image, target);
        let tensor = match self.dssim {
            None => terms,
            Some(dssim) => {
                let loss = unwrap(ssim::loss(&launch.client, &launch.floats(terms), dssim as f32));
                launch.float_tensor(loss, [1])
            }
        };
        Output { tensor, saved: Tensors::of_floats(maps) }
    }

    fn backward(
        &self,
        mut state: State<CubeBackend, 2, 0>,
        v: CubeTensor,
        wanted: [bool; 2],
    ) -> [Option<CubeTensor>; 2] {
        let launch = Launch::of(&v);
        let v_terms = match self.dssim {
            None => v,
            Some(dssim) => {
                let v_terms = unwrap(ssim::loss_backward(&launch.client, &launch.floats(v), dssim as f32));
                launch.float_tensor(v_terms, [2])
            }
        };
        let (inputs, (maps, [])) = (state.inputs(), state.saved.into_arrays());
        let swapped = |target, image| compare(target, image).1;
        let gradient = |image, target, maps| by_image(image, target, maps, v_terms.clone());
        Self::by_both(inputs, maps, wanted, swapped, gradient)
    }
}
