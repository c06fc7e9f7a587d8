//! Operations on images on a GPU: parts, lookups, means over an exposure, the photometric terms.

use burn_cubecl::CubeBackend;
use burn_cubecl::tensor::CubeTensor;
use gs_kernels::cube::{bilinear, channels, exposure, ssim};

use super::{Launch, unwrap};
use crate::ops::bilinear::BilinearKernels;
use crate::ops::channels::ChannelsKernels;
use crate::ops::exposure::{AverageConfig, AverageKernels};
use crate::ops::ssim::{SsimForward, SsimKernels};

impl BilinearKernels for CubeBackend {
    fn bilinear_forward(image: CubeTensor, positions: CubeTensor) -> CubeTensor {
        let (launch, count) = (Launch::of(&image), positions.meta.shape()[0]);
        let [height, width, channels] = image.meta.shape().dims();
        let [image, positions] = [image, positions].map(|t| launch.floats(t));
        let values = bilinear::forward(&launch.client, &image, [height, width], channels, &positions);
        launch.float_tensor(unwrap(values), [count, channels])
    }

    fn bilinear_by_image(size: [usize; 2], positions: CubeTensor, v: CubeTensor) -> CubeTensor {
        let (launch, channels) = (Launch::of(&v), v.meta.shape()[1]);
        let [positions, v] = [positions, v].map(|t| launch.floats(t));
        let v_image = bilinear::by_image(&launch.client, size, channels, &positions, &v);
        launch.float_tensor(unwrap(v_image), [size[0], size[1], channels])
    }

    fn bilinear_by_positions(image: CubeTensor, positions: CubeTensor, v: CubeTensor) -> CubeTensor {
        let (launch, count) = (Launch::of(&image), positions.meta.shape()[0]);
        let [height, width, channels] = image.meta.shape().dims();
        let [image, positions, v] = [image, positions, v].map(|t| launch.floats(t));
        let v_positions = bilinear::by_positions(&launch.client, &image, [height, width], channels, &positions, &v);
        launch.float_tensor(unwrap(v_positions), [count, 2])
    }
}

impl ChannelsKernels for CubeBackend {
    fn channels_forward(image: CubeTensor, first: usize, count: usize) -> CubeTensor {
        let launch = Launch::of(&image);
        let [height, width, total] = image.meta.shape().dims();
        let part = channels::forward(&launch.client, &launch.floats(image), total, first, count);
        launch.float_tensor(unwrap(part), [height, width, count])
    }

    fn channels_backward(v: CubeTensor, first: usize, total: usize) -> CubeTensor {
        let launch = Launch::of(&v);
        let [height, width, count] = v.meta.shape().dims();
        let whole = channels::backward(&launch.client, &launch.floats(v), total, first, count);
        launch.float_tensor(unwrap(whole), [height, width, total])
    }
}

impl AverageKernels for CubeBackend {
    fn average_forward(tiles: CubeTensor, shares: CubeTensor, instants: usize, config: &AverageConfig) -> CubeTensor {
        let launch = Launch::of(&tiles);
        let shares = launch.ints(shares);
        let image = exposure::average(&launch.client, config, &shares, instants, &launch.floats(tiles));
        launch.float_tensor(unwrap(image), [config.height as usize, config.width as usize, config.channels])
    }

    fn average_backward(
        tiles: CubeTensor,
        shares: CubeTensor,
        instants: usize,
        config: &AverageConfig,
        v_image: CubeTensor,
    ) -> CubeTensor {
        let (launch, shape) = (Launch::of(&tiles), tiles.meta.shape().clone());
        let shares = launch.ints(shares);
        let [tiles, v_image] = [tiles, v_image].map(|t| launch.floats(t));
        let v_tiles = exposure::average_backward(&launch.client, config, &shares, instants, &tiles, &v_image);
        launch.shaped(unwrap(v_tiles), shape)
    }
}

impl SsimKernels for CubeBackend {
    fn ssim_forward(image: CubeTensor, target: CubeTensor) -> SsimForward<Self> {
        let launch = Launch::of(&image);
        let [height, width, channels] = image.meta.shape().dims();
        let [image, target] = [image, target].map(|t| launch.floats(t));
        let result = unwrap(ssim::forward(&launch.client, &image, &target, width, height, channels));
        SsimForward {
            terms: launch.float_tensor(result.means, [2]),
            saved: launch.float_tensor(result.saved, [3, height, width, channels]),
        }
    }

    fn ssim_loss(terms: CubeTensor, dssim: f64) -> CubeTensor {
        let launch = Launch::of(&terms);
        launch.float_tensor(unwrap(ssim::loss(&launch.client, &launch.floats(terms), dssim as f32)), [1])
    }

    fn ssim_loss_backward(v: CubeTensor, dssim: f64) -> CubeTensor {
        let launch = Launch::of(&v);
        launch.float_tensor(unwrap(ssim::loss_backward(&launch.client, &launch.floats(v), dssim as f32)), [2])
    }

    fn ssim_backward(image: CubeTensor, target: CubeTensor, saved: CubeTensor, v_terms: CubeTensor) -> CubeTensor {
        let launch = Launch::of(&image);
        let [height, width, channels] = image.meta.shape().dims();
        let [image, target, saved, v_terms] = [image, target, saved, v_terms].map(|t| launch.floats(t));
        let v_image = ssim::backward(&launch.client, &image, &target, &saved, width, height, channels, &v_terms);
        launch.float_tensor(unwrap(v_image), [height, width, channels])
    }
}
