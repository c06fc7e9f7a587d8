//! The limits of a scene: those of the kernels, as sentences, and those of a device.

use burn::tensor::Device;
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

/// Bytes of a Gaussian in the largest buffer of a scene: its coefficients of spherical harmonics, or up to degree 1 the
/// gradients of the rasterizer, which are one buffer (8 of the projected row, opacity, 3 colours, 4 of the screen).
fn bytes_of_a_gaussian(sh_degree: usize) -> u64 {
    4 * (3 * (sh_degree as u64 + 1).pow(2)).max(16)
}

/// Most Gaussians with `sh_degree` that buffers of `bytes` hold, each of their tensors in one.
pub fn gaussians_within(bytes: u64, sh_degree: usize) -> u64 {
    bytes / bytes_of_a_gaussian(sh_degree)
}

/// How often `values` fit one buffer of at most `largest` bytes; at least once.
pub(crate) fn copies_within(largest: Option<u64>, values: usize) -> usize {
    let bytes = (values as u64).saturating_mul(4).max(1);
    largest.map_or(usize::MAX, |largest| (largest / bytes).max(1) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_buffer_of_128_mib_holds_so_many() {
        let bytes = 128 << 20;
        assert_eq!(gaussians_within(bytes, 3), 699_050);
        assert_eq!(gaussians_within(bytes, 2), 1_242_756);
        assert_eq!(gaussians_within(bytes, 0), 2_097_152);
        assert!(gaussians_within(256 << 20, 3) >= 1_000_000);
    }

    #[test]
    fn copies_fit_a_buffer() {
        assert_eq!(copies_within(None, 5 * 48), usize::MAX);
        assert_eq!(copies_within(Some(2 * 5 * 192), 5 * 48), 2);
        assert_eq!([0, 4].map(|rows| copies_within(Some(100), rows * 48)), [100, 1]);
    }
}
