//! Voxels for tests of sparse convolution.

/// Voxels of [`surface`] are in `0..SIDE` on each axis.
pub const SIDE: usize = 16;

/// Voxels on a bent sheet with holes and a pole through it, in `batches` batches, ascending.
pub fn surface(batches: i32) -> Vec<[i32; 4]> {
    let side = SIDE as i32;
    let sheet = (0..batches).flat_map(move |b| {
        (0..side).flat_map(move |x| (0..side).map(move |y| [b, x, y, (x * x / 2 + 3 * y + b) / 10]))
    });
    let pole = (0..batches).flat_map(move |b| (0..side).map(move |z| [b, 7, 8, z]));
    let mut voxels: Vec<[i32; 4]> = sheet.filter(|[b, x, y, _]| (x * 5 + y * 3 + b) % 4 != 0).chain(pole).collect();
    voxels.sort_unstable();
    voxels.dedup();
    assert!(voxels.iter().all(|voxel| voxel[1..].iter().all(|c| (0..side).contains(c))), "voxels in the grid");
    voxels
}
