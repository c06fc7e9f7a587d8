//! Numbers that a shader compiler sees to be the same for all units of a cube.
//!
//! A barrier may stand in a loop or behind a condition only if all units of the cube take part. WGSL has compilers
//! prove that, and a number read from a buffer proves nothing where the buffer may be written, as CubeCL declares every
//! buffer outside browsers. Chrome's compiler then refuses the shader, and so does the older one of DirectX 12.

use cubecl::prelude::*;

/// `value` of the first unit, for all units of the cube; `slot` holds one number. It contains a barrier. All units must
/// call this, and may call it again with the same slot behind another barrier.
#[cube]
pub(crate) fn of_first_unit(value: u32, slot: &mut Shared<[u32]>) -> u32 {
    if UNIT_POS == 0 {
        slot[0] = value;
    }
    workgroup_uniform_load(&slot[0])
}
