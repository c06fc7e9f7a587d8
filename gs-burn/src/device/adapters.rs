//! The adapters of a build's GPU backends as descriptions.

#[cfg(any(feature = "wgpu", feature = "vulkan", feature = "metal"))]
use std::sync::OnceLock;

use burn::backend::DispatchDevice;
use burn::tensor::Device;
use burn_cubecl::CubeDevice;

#[cfg(any(feature = "wgpu", feature = "vulkan", feature = "metal"))]
use super::DeviceKind;
use super::choice::{Abilities, AdapterClass};

/// The sort of a device, which is not opened for that.
pub(super) fn class_of(device: &Device) -> AdapterClass {
    cube_of(device).map_or(AdapterClass::Other, class_of_cube)
}

/// [`class_of`] a device of CubeCL's.
#[allow(clippy::match_single_binding)] // A build for CUDA alone has one arm.
pub(crate) fn class_of_cube(device: &CubeDevice) -> AdapterClass {
    match device {
        #[cfg(any(feature = "wgpu", feature = "vulkan", feature = "metal"))]
        CubeDevice::Wgpu(own) => {
            use burn_cubecl::cubecl::wgpu::WgpuDeviceKind;
            match own.kind {
                WgpuDeviceKind::DiscreteGpu(_) => AdapterClass::Discrete,
                WgpuDeviceKind::IntegratedGpu(_) => AdapterClass::Integrated,
                WgpuDeviceKind::VirtualGpu(_) => AdapterClass::Virtual,
                WgpuDeviceKind::Cpu => AdapterClass::Software,
                WgpuDeviceKind::DefaultDevice => class_of_default(),
                _ => AdapterClass::Other,
            }
        }
        _ => AdapterClass::Discrete,
    }
}

/// The sort of the platform's default: of the best adapter, for which CubeCL asks by its power. The adapters are listed
/// once.
#[cfg(any(feature = "wgpu", feature = "vulkan", feature = "metal"))]
fn class_of_default() -> AdapterClass {
    static FOUND: OnceLock<AdapterClass> = OnceLock::new();
    *FOUND.get_or_init(|| {
        // With this variable a user makes CubeCL take another.
        if std::env::var_os("CUBECL_WGPU_DEFAULT_DEVICE").is_some() {
            return AdapterClass::Other;
        }
        let kinds = [DeviceKind::Metal, DeviceKind::Vulkan, DeviceKind::Wgpu].into_iter();
        let listed = kinds.filter(|kind| kind.is_built()).flat_map(DeviceKind::list);
        listed.map(|device| class_of(&device)).min().unwrap_or(AdapterClass::Other)
    })
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

#[cfg(test)]
mod tests {
    #[cfg(feature = "wgpu")]
    #[test]
    fn the_default_has_the_class_of_the_best_adapter() {
        use super::{DeviceKind, class_of};
        let best = DeviceKind::Wgpu.list().iter().map(class_of).min();
        assert_eq!(Some(class_of(&DeviceKind::Wgpu.default_device())), best);
    }
}
