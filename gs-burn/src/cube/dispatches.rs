//! How much one launch may do before a driver takes the device for hung.
//!
//! Windows resets a GPU after two seconds in one launch, and a desktop stutters long before; the aim is half a second
//! on a small GPU in a processor. By the model in BENCHMARKS.md the backward pass of the rasterizer is the longest
//! launch. Its pairs are processed in ranges of tiles, so their bytes bound its time, and the bound does not change a
//! bit of the result.

use burn_cubecl::CubeDevice;
use gs_kernels::cube::rasterize::PAIR_BYTES;

/// Most bytes of pair rows in a launch where the device may be a GPU in a processor: 4.6 million pairs of three
/// channels, which take 480 warp instructions each if no pixel ends before them, at 4.8 G a second (24 units of 8 lanes
/// at 1.15 GHz, 70 % used) 0.46 s.
const PAIR_BYTES_OF_SMALL: usize = 192 << 20;

/// Most bytes of pair rows in a launch of the rasterizer's backward pass on this device. A scene with more pairs reads
/// the tiles' offsets back, which waits for the device.
pub(super) fn pair_bytes(device: &CubeDevice) -> usize {
    if may_be_small(device) { PAIR_BYTES_OF_SMALL } else { PAIR_BYTES }
}

/// An adapter that was not asked for by its class may be of any.
#[cfg(any(feature = "wgpu", feature = "vulkan", feature = "metal"))]
fn may_be_small(device: &CubeDevice) -> bool {
    use burn_cubecl::cubecl::wgpu::WgpuDeviceKind;
    matches!(device, CubeDevice::Wgpu(own) if !matches!(own.kind, WgpuDeviceKind::DiscreteGpu(_)))
}

/// CUDA's devices are cards.
#[cfg(not(any(feature = "wgpu", feature = "vulkan", feature = "metal")))]
fn may_be_small(_: &CubeDevice) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Warp instructions a second of the small GPU of the model, and of a pair (BENCHMARKS.md).
    const SMALL_GPU: f64 = 4.8e9;
    const OF_A_PAIR: f64 = 480.0;

    #[test]
    fn a_launch_takes_half_a_second_on_a_small_gpu_by_the_model() {
        let pairs = (PAIR_BYTES_OF_SMALL / (4 * 11)) as f64;
        assert!(pairs * OF_A_PAIR / SMALL_GPU <= 0.5);
        const { assert!(PAIR_BYTES_OF_SMALL < PAIR_BYTES) };
    }

    #[cfg(feature = "wgpu")]
    #[test]
    fn only_a_card_has_the_large_bound() {
        use burn_cubecl::cubecl::wgpu::{WgpuDevice, WgpuDeviceKind};
        let of = |kind| pair_bytes(&CubeDevice::Wgpu(WgpuDevice::new(kind)));
        assert_eq!(of(WgpuDeviceKind::DiscreteGpu(1)), PAIR_BYTES);
        for kind in [WgpuDeviceKind::IntegratedGpu(0), WgpuDeviceKind::Cpu, WgpuDeviceKind::DefaultDevice] {
            assert_eq!(of(kind), PAIR_BYTES_OF_SMALL);
        }
    }
}
