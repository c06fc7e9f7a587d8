//! Points into voxels.

use rayon::prelude::*;

use super::keys::{COORDINATE_LIMIT, SparseError, pack, unpack};

/// The voxels that hold points.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Voxels {
    /// `[V, 4]`: batch 0 and x, y, z of each voxel, ascending.
    pub coordinates: Vec<[i32; 4]>,
    /// `[N]`: the voxel of each point.
    pub of_point: Vec<u32>,
    /// `[N]`: points by voxel, then by their own x, y, z. Sums in this order do not depend on the order of the
    /// points, but for points at one place, which follow their index.
    pub order: Vec<u32>,
}

/// The voxels of edge `size` that hold points, `floor(point / size)` on each axis.
///
/// `points` `[N]` and `size` are in one unit of length. The quotient is computed in `f64`.
///
/// # Errors
/// When a point is not finite or out of the range of coordinates, or `size` is not positive.
pub fn voxels(points: &[[f32; 3]], size: f32) -> Result<Voxels, SparseError> {
    if !(size.is_finite() && size > 0.0) {
        return Err(SparseError::VoxelSize { found: size.to_string() });
    }
    let bad = |point: &[f32; 3]| point.iter().any(|x| !x.is_finite());
    if let Some(row) = points.par_iter().position_first(bad) {
        return Err(SparseError::Point { row, found: format!("{:?}", points[row]) });
    }
    // A conversion to `i32` saturates, which is out of range too.
    let voxel = |point: &[f32; 3]| point.map(|x| (f64::from(x) / f64::from(size)).floor() as i32);
    let outside = |[x, y, z]: [i32; 3]| [x, y, z].iter().any(|c| !(-COORDINATE_LIMIT..=COORDINATE_LIMIT).contains(c));
    if let Some(row) = points.par_iter().position_first(|point| outside(voxel(point))) {
        return Err(SparseError::OutOfRange { row, found: voxel(&points[row]) });
    }
    let key = |point: &[f32; 3]| {
        let [x, y, z] = voxel(point);
        pack([0, x, y, z])
    };
    let mut sorted: Vec<(u64, u32)> = points.par_iter().map(key).zip(0..points.len() as u32).collect();
    sorted.par_sort_unstable_by(|a, b| {
        let place = |i: u32| points[i as usize];
        let by_place = || {
            let (p, q) = (place(a.1), place(b.1));
            (0..3).map(|axis| p[axis].total_cmp(&q[axis])).find(|order| order.is_ne()).unwrap_or(a.1.cmp(&b.1))
        };
        a.0.cmp(&b.0).then_with(by_place)
    });
    let (mut coordinates, mut of_point) = (Vec::new(), vec![0; points.len()]);
    for (at, (key, point)) in sorted.iter().enumerate() {
        if at == 0 || sorted[at - 1].0 != *key {
            coordinates.push(unpack(*key));
        }
        of_point[*point as usize] = coordinates.len() as u32 - 1;
    }
    Ok(Voxels { coordinates, of_point, order: sorted.into_iter().map(|(_, point)| point).collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_in_their_voxels() {
        let points = [[0.3, 0.1, -0.1], [-0.3, 0.0, 0.0], [0.2, 0.1, -0.4], [0.25, 0.1, -0.2], [7.0, 0.0, 0.0]];
        let found = voxels(&points, 0.5).unwrap();
        assert_eq!(found.coordinates, [[0, -1, 0, 0], [0, 0, 0, -1], [0, 14, 0, 0]]);
        assert_eq!(found.of_point, [1, 0, 1, 1, 2]);
        assert_eq!(found.order, [1, 2, 3, 0, 4]);
        assert_eq!(voxels(&[], 0.5).unwrap().coordinates, [[0; 4]; 0]);
    }

    #[test]
    fn bad_points_are_told() {
        let error = |point: [f32; 3], size: f32| voxels(&[[0.0; 3], point], size).unwrap_err().to_string();
        assert!(error([0.0, f32::NAN, 0.0], 0.1).starts_with("point 1 is at [0.0, NaN, 0.0]"));
        assert!(error([0.0, f32::INFINITY, 0.0], 0.1).starts_with("point 1 is at"));
        assert!(error([1e20, 0.0, 0.0], 0.1).starts_with("row 1 has the coordinates [2147483647, 0, 0]"));
        for size in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(error([0.0; 3], size).contains("edge"), "{size}");
        }
        let limit = COORDINATE_LIMIT as f32;
        assert!(voxels(&[[limit, -limit, 0.0]], 1.0).is_ok() && voxels(&[[limit + 1.0, 0.0, 0.0]], 1.0).is_err());
    }
}
