//! Adapters on which kernels in SPIR-V would crash the driver.
//!
//! A build with `vulkan` compiles to SPIR-V on every Vulkan adapter, also for `--device wgpu`. Without
//! `VK_KHR_workgroup_memory_explicit_layout` CubeCL 0.11.3 makes a module that is not valid for every kernel with
//! shared memory (`docs/upstream/cubecl-spirv-shared-memory.md`), and drivers need not survive one. The extension can
//! be asked of the adapter only while the device is opened, because CubeCL gives its adapter to no one afterwards.

use std::sync::{Mutex, PoisonError};

use burn::tensor::Device;
use burn_cubecl::CubeDevice;
use burn_cubecl::cubecl::wgpu::wgpu;
use burn_cubecl::cubecl::wgpu::{AutoGraphicsApi, RuntimeOptions, WgpuDevice, WgpuInitError, try_init_setup};

use super::adapters::cube_of;

/// The extension, which fixes where a variable of shared memory lies.
const LAYOUT: &std::ffi::CStr = c"VK_KHR_workgroup_memory_explicit_layout";

/// The adapters asked so far, with their refusals.
static ASKED: Mutex<Vec<(WgpuDevice, Option<String>)>> = Mutex::new(Vec::new());

/// Opens `device` and says why its driver must not be given a kernel in SPIR-V, if so. A device that the process has
/// opened by other means before cannot be asked; it is not refused.
pub(super) fn refusal(device: &Device) -> Option<String> {
    let Some(CubeDevice::Wgpu(own)) = cube_of(device) else { return None };
    let mut asked = ASKED.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, refusal)) = asked.iter().find(|(known, _)| known == own) {
        return refusal.clone();
    }
    let refusal = match try_init_setup::<AutoGraphicsApi>(own, RuntimeOptions::default()) {
        Ok(setup) => refusal_of(&setup.adapter, CubeDevice::Wgpu(own.clone()).client().name()),
        Err(WgpuInitError::Registration { .. }) => None,
        Err(error) => Some(error.to_string()),
    };
    asked.push((own.clone(), refusal.clone()));
    refusal
}

/// The refusal of an adapter whose kernels the `runtime` of this name compiles.
fn refusal_of(adapter: &wgpu::Adapter, runtime: &str) -> Option<String> {
    if runtime != "wgpu<spirv>" {
        return None;
    }
    // SAFETY: the guard is only read, and dropped before the adapter.
    let vulkan = unsafe { adapter.as_hal::<wgpu::hal::api::Vulkan>() }?;
    let lacking = !vulkan.physical_device_capabilities().supports_extension(LAYOUT);
    let name = adapter.get_info().name;
    lacking.then(|| {
        format!(
            "{name} lacks {}, which kernels in SPIR-V need: build with `--features wgpu` and without `vulkan`, and take \
             `--device wgpu`",
            LAYOUT.to_string_lossy()
        )
    })
}
