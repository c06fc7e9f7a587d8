//! The device's statement about itself: the limits that WebGPU grants everywhere.

use cubecl::ir::features::{AtomicUsage, Features, TypeUsage};
use cubecl::ir::{
    AddressType, DeviceIdentity, DeviceProperties, ElemType, FloatKind, HardwareProperties, IntKind,
    MemoryDeviceProperties, Type, UIntKind,
};
use cubecl::profile::TimingMethod;

/// Most bytes of a buffer, as WebGPU grants them.
const MOST_BYTES: u64 = 128 << 20;
/// Alignment of a binding in bytes, the strictest in use.
pub(super) const ALIGNMENT: usize = 256;
/// Bytes of shared memory that WebGPU grants.
const SHARED_BYTES: usize = 16 << 10;
/// Units of a cube that WebGPU grants.
const MOST_UNITS: u32 = 256;
/// Cubes along an axis that WebGPU grants.
const MOST_CUBES: u32 = 65_535;
/// Storage buffers that WebGPU grants, less the one that carries a kernel's numbers.
const MOST_BUFFERS: u32 = 7;

/// A device with WebGPU's default limits.
pub(super) fn properties() -> DeviceProperties {
    let hardware = HardwareProperties {
        load_width: 128,
        vector_register_count: None,
        plane_size_min: 32,
        plane_size_max: 32,
        max_bindings: MOST_BUFFERS,
        max_shared_memory_size: SHARED_BYTES,
        max_cube_count: (MOST_CUBES, MOST_CUBES, MOST_CUBES),
        max_units_per_cube: MOST_UNITS,
        max_cube_dim: (MOST_UNITS, MOST_UNITS, 64),
        num_streaming_multiprocessors: None,
        num_cpu_cores: None,
        last_level_cache_size: None,
        num_tensor_cores: None,
        min_tensor_cores_dim: None,
        max_vector_size: 4,
        cube_mma_reserved_shared_memory: 0,
    };
    let memory = MemoryDeviceProperties::new(MOST_BYTES, ALIGNMENT as u64);
    let name = || String::from("interpreter");
    let identity = DeviceIdentity { name: name(), fingerprint: name(), physical: None };
    let mut properties = DeviceProperties::new(Features::default(), memory, hardware, TimingMethod::System, identity);
    let (u32, i32) = (ElemType::UInt(UIntKind::U32), ElemType::Int(IntKind::I32));
    for ty in [u32, i32, ElemType::Index, ElemType::Float(FloatKind::F32), ElemType::Bool] {
        properties.register_type_usage(ty, TypeUsage::all());
    }
    for ty in [u32, i32] {
        let usage = AtomicUsage::LoadStore | AtomicUsage::Exchange | AtomicUsage::Add;
        properties.register_atomic_type_usage(Type::atomic(ty), usage);
    }
    properties.register_address_type(AddressType::U32);
    properties
}
