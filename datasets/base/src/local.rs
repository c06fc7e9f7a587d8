//! Positions far from the origin of their world. `f32` has seven digits, so a scene in map coordinates is kept as local
//! positions and an offset of three `f64`, which is added to each of them.

use crate::statistics::median;

/// A scene is moved to the origin when the mean of its camera centres, or the middle of its Gaussians, is farther from
/// it than this, in scene units. At 1000 the spacing of f32 is 6e-5: in metres, millimetres survive a few dozen
/// roundings. City coordinates (1e4 and more) would lose them, while an ordinary scene stays in its file's world, where
/// exported files match other tools.
pub const RECENTRE_DISTANCE: f64 = 1000.0;

/// Largest part of an offset, scene units: squares of distances stay within what an f32 holds.
pub const OFFSET_MAX: f64 = 1e15;

/// Whether an offset is so large that local positions are kept beside it, and not added up with it.
pub fn is_far(offset: [f64; 3]) -> bool {
    offset.iter().map(|x| x * x).sum::<f64>().sqrt() > RECENTRE_DISTANCE
}

/// Whether three numbers of a file can be an offset.
pub fn is_offset(offset: [f64; 3]) -> bool {
    offset.iter().all(|x| x.abs() <= OFFSET_MAX)
}

/// Positions of a file that are finite, to which its `offset` is to be added, as local positions and their offset. The
/// offset stays as it is where it is far and the positions are not; it is zero where the world's origin is near the
/// middle of the scene.
pub fn localised(positions: &[[f64; 3]], offset: [f64; 3]) -> (Vec<[f32; 3]>, [f64; 3]) {
    let own = choose(middle(positions), offset);
    let shift = [0, 1, 2].map(|axis| offset[axis] - own[axis]);
    // The difference of two f32 may be more than an f32 holds.
    let local = |x: f64| x.clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32;
    (positions.iter().map(|position| [0, 1, 2].map(|axis| local(position[axis] + shift[axis]))).collect(), own)
}

fn choose(middle: [f64; 3], offset: [f64; 3]) -> [f64; 3] {
    let whole = [0, 1, 2].map(|axis| middle[axis] + offset[axis]);
    match (is_far(whole), is_far(middle)) {
        // Whole numbers are exact in any text.
        (true, true) if is_offset(whole) => whole.map(f64::round),
        (true, false) => offset,
        _ => [0.0; 3],
    }
}

/// The median along each axis: a few broken positions do not move it. Zeros without positions.
fn middle(positions: &[[f64; 3]]) -> [f64; 3] {
    [0, 1, 2].map(|axis| median(positions.iter().map(|position| position[axis]).collect()).unwrap_or(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_positions_stay_as_they_are() {
        let positions = [[1.5, -2.0, 999.0], [0.1, 1e9, 3.0], [-1.0, 2.0, 3.0]];
        let (local, offset) = localised(&positions, [0.0; 3]);
        assert_eq!((local, offset), (positions.map(|p| p.map(|x| x as f32)).to_vec(), [0.0; 3]));
        assert!(localised(&[], [0.0; 3]).0.is_empty());
    }

    /// Map coordinates in doubles: millimetres are left. One broken position moves nothing.
    #[test]
    fn far_positions_become_local_ones() {
        let world = [450_123.125, 5_200_456.375, 300.0];
        let mut positions: Vec<[f64; 3]> = (0..9).map(|i| world.map(|x| x + 0.001 * f64::from(i))).collect();
        positions[3] = [-3e38, 0.0, 3e38];
        let (local, offset) = localised(&positions, [0.0; 3]);
        assert_eq!(offset, [450_123.0, 5_200_456.0, 300.0]);
        assert!((f64::from(local[8][0]) - 0.133).abs() < 1e-7 && (f64::from(local[8][2]) - 0.008).abs() < 1e-7);
        assert!(local.iter().flatten().all(|x| x.is_finite()));
    }

    #[test]
    fn an_offset_is_kept_or_added() {
        let far = [1e6 + 0.1, 0.2, -0.3];
        let (local, offset) = localised(&[[1.0, 2.0, 3.0]], far);
        assert_eq!((local, offset), (vec![[1.0, 2.0, 3.0]], far));
        let (local, offset) = localised(&[[1.0, 2.0, 3.0]], [10.0, 0.0, 0.0]);
        assert_eq!((local, offset), (vec![[11.0, 2.0, 3.0]], [0.0; 3]));
        let (local, offset) = localised(&[[-1e6, 0.0, 0.0]], far);
        assert_eq!((local, offset), (vec![[0.1, 0.2, -0.3]], [0.0; 3]), "they cancel");
        let (local, offset) = localised(&[[1e6, 2e6, 0.0]], far);
        assert_eq!((local, offset), (vec![[0.1, 0.2, -0.3]], [2e6, 2e6, 0.0]), "both are far");
        assert_eq!(localised(&[[3e38, 0.0, 0.0]], [0.0; 3]), (vec![[3e38, 0.0, 0.0]], [0.0; 3]), "no place at all");
        assert!(is_far(far) && is_offset(far) && !is_far([900.0, 0.0, 0.0]));
        assert!(!is_offset([f64::NAN, 0.0, 0.0]) && !is_offset([0.0, 1e16, 0.0]));
    }
}
