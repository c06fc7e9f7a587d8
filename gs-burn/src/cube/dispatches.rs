//! How much one launch may do before a driver takes the device for hung.
//!
//! Windows resets a GPU after two seconds in one launch, and a desktop stutters long before; the aim is half a second
//! on a small GPU in a processor. By the model in BENCHMARKS.md the backward pass of the rasterizer is the longest
//! launch. Its pairs are processed in ranges of tiles, so their bytes bound its time, and the bound does not change a
//! bit of the result.

use burn_cubecl::CubeDevice;
use burn_cubecl::cubecl::client::Client;
use gs_kernels::cube::rasterize::PAIR_BYTES;

use crate::device::{AdapterClass, class_of_cube};

/// Most bytes of pair rows in a launch where the device may be a GPU in a processor: 4.6 million pairs of three
/// channels, which take 480 warp instructions each if no pixel ends before them, at 4.8 G a second (24 units of 8 lanes
/// at 1.15 GHz, 70 % used) 0.46 s.
const PAIR_BYTES_OF_SMALL: usize = 192 << 20;

/// The share of a card's memory that pair rows may take. A scene with as many pairs fills the rest with its lists, its
/// Gaussians and their moments.
const SHARE_OF_MEMORY: u64 = 8;

/// Most bytes of pair rows in a launch of the rasterizer's backward pass on this device, whose buffers are smaller
/// still where its driver says so. A scene with more pairs reads the tiles' offsets back, which waits for the device.
pub(super) fn pair_bytes(device: &CubeDevice, client: &Client) -> usize {
    bytes_of(class_of_cube(device), client.properties().memory.max_memory())
}

/// [`pair_bytes`] of an adapter of this class with so many bytes of memory, if its driver says.
fn bytes_of(class: AdapterClass, memory: Option<u64>) -> usize {
    let of_card = |memory: u64| usize::try_from(memory / SHARE_OF_MEMORY).unwrap_or(usize::MAX);
    match class {
        AdapterClass::Discrete => memory.map_or(PAIR_BYTES, of_card).max(PAIR_BYTES_OF_SMALL),
        _ => PAIR_BYTES_OF_SMALL,
    }
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

    #[test]
    fn a_card_has_an_eighth_of_its_memory_and_others_the_small_bound() {
        assert_eq!(bytes_of(AdapterClass::Discrete, Some(24 << 30)), 3 << 30);
        assert_eq!(bytes_of(AdapterClass::Discrete, Some(8 << 30)), 1 << 30);
        assert_eq!(bytes_of(AdapterClass::Discrete, None), PAIR_BYTES);
        for class in [AdapterClass::Integrated, AdapterClass::Virtual, AdapterClass::Other, AdapterClass::Software] {
            assert_eq!(bytes_of(class, Some(24 << 30)), PAIR_BYTES_OF_SMALL);
        }
    }
}
