//! The adapters of a build's GPU backends as descriptions.

use burn::backend::DispatchDevice;
use burn::tensor::Device;
use burn_cubecl::CubeDevice;

use super::choice::{Abilities, AdapterClass};

/// The sort of a device, which is not opened for that.
#[allow(clippy::match_single_binding)] // A build for CUDA alone has one arm.
pub(super) fn class_of(device: &Device) -> AdapterClass {
    match cube_of(device) {
        #[cfg(any(feature = "wgpu", feature = "vulkan", feature = "metal"))]
        Some(CubeDevice::Wgpu(own)) => {
            use burn_cubecl::cubecl::wgpu::WgpuDeviceKind;
            match own.kind {
                WgpuDeviceKind::DiscreteGpu(_) => AdapterClass::Discrete,
                WgpuDeviceKind::IntegratedGpu(_) => AdapterClass::Integrated,
                WgpuDeviceKind::VirtualGpu(_) => AdapterClass::Virtual,
                WgpuDeviceKind::Cpu => AdapterClass::Software,
                _ => AdapterClass::Other,
            }
        }
        _ => AdapterClass::Discrete,
    }
}

/// The statement of a device about itself. It is opened for that.
pub(super) fn abilities(device: &Device) -> Option<Abilities> {
    let client = cube_of(device)?.client();
    let (hardware, memory) = (&client.properties().hardware, &client.properties().memory);
    Some(Abilities {
        name: client.properties().identity.name.clone(),
        memory: memory.max_memory(),
        binding: memory.max_page_size,
        bindings: hardware.max_bindings,
        units: hardware.max_units_per_cube,
        shared: hardware.max_shared_memory_size as u64,
        cubes: hardware.max_cube_count.0,
    })
}

/// A device of CubeCL's, which are GPUs.
pub(super) fn cube_of(device: &Device) -> Option<&CubeDevice> {
    match device.as_dispatch() {
        DispatchDevice::Cube(own) => Some(own),
        #[allow(unreachable_patterns)] // A build without a CPU backend has no other variant but autodiff's.
        _ => None,
    }
}
