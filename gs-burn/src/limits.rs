//! The limits of a scene: those of the kernels, as sentences, and those of a device.

use burn::tensor::Device;
use gs_kernels::config::SH_BELOW_THIRD;
pub use gs_kernels::limits::{is_limit, too_many_gaussians};

/// Most bytes of one buffer on `device`, as its driver states them; `None` on a CPU. Opens the device.
#[cfg(feature = "cube")]
pub fn largest_buffer(device: &Device) -> Option<u64> {
    use burn::backend::DispatchDevice;
    use gs_kernels::cube::buffer::most_bytes;

    let device = device.clone().inner();
    match device.as_dispatch() {
        DispatchDevice::Cube(device) => Some(most_bytes(&device.client())),
        _ => None,
    }
}

/// A build without CubeCL has CPUs only.
#[cfg(not(feature = "cube"))]
pub fn largest_buffer(_: &Device) -> Option<u64> {
    None
}

/// Bytes of a Gaussian's coefficients of spherical harmonics in one tensor.
pub(crate) fn bytes_of_coefficients(coefficients: usize) -> u64 {
    4 * 3 * coefficients as u64
}

/// Bytes of a Gaussian in the largest buffer of a scene: its coefficients of spherical harmonics, at degree 3 those below the third band
/// ([`third_band_apart`]), or up to degree 1 the gradients of the rasterizer, which are one buffer (8 of the projected row, opacity,
/// 3 colours, 4 of the screen).
fn bytes_of_a_gaussian(sh_degree: usize) -> u64 {
    let coefficients = (sh_degree + 1).pow(2).min(SH_BELOW_THIRD);
    bytes_of_coefficients(coefficients).max(4 * 16)
}

/// Most Gaussians with `sh_degree` that buffers of `bytes` hold, each of their tensors in one.
pub fn gaussians_within(bytes: u64, sh_degree: usize) -> u64 {
    bytes / bytes_of_a_gaussian(sh_degree)
}

/// Whether `gaussians` of `coefficients` need a tensor of its own for the third band, on a device with buffers of at most
/// `largest_buffer` bytes.
pub fn third_band_apart(largest_buffer: Option<u64>, gaussians: u64, coefficients: usize) -> bool {
    let needed = gaussians.saturating_mul(bytes_of_coefficients(coefficients));
    coefficients > SH_BELOW_THIRD && largest_buffer.is_some_and(|bytes| needed > bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_buffer_of_128_mib_holds_so_many() {
        let bytes = 128 << 20;
        assert_eq!(gaussians_within(bytes, 3), 1_242_756);
        assert_eq!(gaussians_within(bytes, 2), 1_242_756);
        assert_eq!(gaussians_within(bytes, 0), 2_097_152);
    }

    #[test]
    fn the_third_band_is_apart_only_where_one_tensor_is_too_large() {
        let bytes = Some(128 << 20);
        assert!(!third_band_apart(bytes, 699_050, 16));
        assert!(third_band_apart(bytes, 699_051, 16));
        assert!(!third_band_apart(bytes, 1_000_000, 9), "there is no third band");
        assert!(!third_band_apart(None, u64::MAX, 16), "a CPU");
    }
}
