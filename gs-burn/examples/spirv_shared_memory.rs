//! The smallest kernel with shared memory, for `docs/upstream/cubecl-spirv-shared-memory.md`: 64 numbers are reversed.
//!
//! `cargo run --release -p gs-burn --features vulkan --example spirv_shared_memory` crashes the driver where it lacks
//! `VK_KHR_workgroup_memory_explicit_layout`; with `--features wgpu` (WGSL) it prints `reversed` there. Nothing of this
//! project's is used but the version of CubeCL.

use burn_cubecl::cubecl;
use burn_cubecl::cubecl::prelude::*;

const UNITS: usize = 64;

#[cube(launch)]
fn reverse_kernel(values: &mut [f32]) {
    let mut shared = Shared::<[f32]>::new_slice(UNITS);
    let unit = UNIT_POS as usize;
    shared[unit] = values[unit];
    sync_cube();
    values[unit] = shared[comptime!(UNITS - 1) - unit];
}

fn main() {
    let client = cubecl::Device::default().client();
    println!("{} on {}", client.name(), client.properties().identity.name);
    let values: Vec<f32> = (0..UNITS).map(|k| k as f32).collect();
    let handle = client.create_from_slice(f32::as_bytes(&values));
    // SAFETY: the handle holds as many values.
    let argument = unsafe { BufferArg::from_raw_parts(handle.clone(), UNITS) };
    reverse_kernel::launch(&client, CubeCount::Static(1, 1, 1), CubeDim::new_1d(UNITS as u32), argument);
    let bytes = client.read_one(handle).expect("the device computes");
    let reversed: Vec<f32> = values.into_iter().rev().collect();
    println!("{}", if f32::from_bytes(&bytes) == reversed { "reversed" } else { "wrong" });
}
