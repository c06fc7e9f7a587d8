//! Voxel coordinates as 64-bit keys: 10 bits of batch, then 18 bits each of x, y and z.
//!
//! Keys sort by batch, x, y, z. The key of a neighbour is the key plus a constant, because a margin keeps every axis
//! from overflowing into the next.

use rayon::prelude::*;

/// Number of batch indices: 10 bits.
pub const BATCHES: i32 = 1 << 10;

/// Bits of an axis.
const AXIS_BITS: u32 = 18;

/// Added to a coordinate, so that it is not negative.
const HALF: i32 = 1 << (AXIS_BITS - 1);

/// Largest magnitude of a coordinate, voxels: the range of 18 bits less a margin for the reach of a kernel and the
/// rounding of a stride, each below [`LARGEST_KERNEL`].
pub const COORDINATE_LIMIT: i32 = HALF - 2 * LARGEST_KERNEL as i32 - 2;

/// Largest edge of a kernel, and largest stride.
pub const LARGEST_KERNEL: usize = 15;

/// Largest number of entries of a table of neighbours: a GPU buffer of 2 GiB holds so many numbers of four bytes.
const MOST_ENTRIES: usize = (i32::MAX / 4) as usize;

/// A set of coordinates, or a kernel, that is not accepted.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SparseError {
    /// A coordinate beyond the range of the keys.
    #[error("row {row} has the coordinates {found:?}: expected x, y and z in -{COORDINATE_LIMIT}..={COORDINATE_LIMIT}")]
    OutOfRange {
        /// Row of the coordinates.
        row: usize,
        /// Its x, y, z.
        found: [i32; 3],
    },
    /// A batch index beyond the range of the keys.
    #[error("row {row} has the batch index {found}: expected 0 to {}", BATCHES - 1)]
    Batch {
        /// Row of the coordinates.
        row: usize,
        /// Its batch index.
        found: i32,
    },
    /// Two rows of one voxel.
    #[error("rows {first} and {second} have the same coordinates: expected one row a voxel")]
    Duplicate {
        /// The lower row.
        first: usize,
        /// The other row.
        second: usize,
    },
    /// A kernel that the operation does not know.
    #[error("a kernel of edge {kernel} and stride {stride}: expected {expected}")]
    Kernel {
        /// Edge of the kernel.
        kernel: usize,
        /// Stride.
        stride: usize,
        /// The accepted values.
        expected: &'static str,
    },
    /// A table of neighbours beyond the size of one buffer.
    #[error(
        "{rows} voxels with {offsets} offsets each: expected at most {MOST_ENTRIES} entries of the table of neighbours"
    )]
    TooMany {
        /// Voxels.
        rows: usize,
        /// Offsets of the kernel.
        offsets: usize,
    },
    /// A point that is nowhere.
    #[error("point {row} is at {found}: expected finite coordinates")]
    Point {
        /// Index of the point.
        row: usize,
        /// Its coordinates.
        found: String,
    },
    /// A voxel without a size.
    #[error("a voxel has the edge {found}: expected a positive length")]
    VoxelSize {
        /// The edge.
        found: String,
    },
    /// A segment index without a segment.
    #[error("row {row} is in segment {found}: expected an index below {segments}")]
    Segment {
        /// The row.
        row: usize,
        /// Its segment.
        found: u32,
        /// Number of segments.
        segments: usize,
    },
}

/// The key of `[batch, x, y, z]`, each in range.
pub(super) fn pack([batch, x, y, z]: [i32; 4]) -> u64 {
    let axis = |c: i32| (c + HALF) as u64;
    (batch as u64) << (3 * AXIS_BITS) | axis(x) << (2 * AXIS_BITS) | axis(y) << AXIS_BITS | axis(z)
}

/// The coordinates of a key.
pub(super) fn unpack(key: u64) -> [i32; 4] {
    let axis = |shift: u32| ((key >> shift) & ((1 << AXIS_BITS) - 1)) as i32 - HALF;
    [(key >> (3 * AXIS_BITS)) as i32, axis(2 * AXIS_BITS), axis(AXIS_BITS), axis(0)]
}

/// The number to add to a key to move by `[x, y, z]`.
pub(super) fn shift([x, y, z]: [i64; 3]) -> i64 {
    (x << (2 * AXIS_BITS)) + (y << AXIS_BITS) + z
}

/// Keys in ascending order and the row of each.
#[derive(Debug, Clone)]
pub(super) struct SortedKeys {
    pub keys: Vec<u64>,
    /// Row of each key; `None` where row `i` has key `i`.
    pub rows: Option<Vec<u32>>,
}

impl SortedKeys {
    /// Checks and sorts coordinates `[batch, x, y, z]`.
    pub fn of(coordinates: &[[i32; 4]]) -> Result<Self, SparseError> {
        check(coordinates)?;
        let keys: Vec<u64> = coordinates.par_iter().map(|c| pack(*c)).collect();
        if keys.is_sorted_by(|a, b| a < b) {
            return Ok(Self { keys, rows: None });
        }
        let mut pairs: Vec<(u64, u32)> = keys.into_iter().zip(0..).collect();
        pairs.par_sort_unstable();
        if let Some(same) = pairs.windows(2).find(|w| w[0].0 == w[1].0) {
            return Err(SparseError::Duplicate { first: same[0].1 as usize, second: same[1].1 as usize });
        }
        let (keys, rows) = pairs.into_iter().unzip();
        Ok(Self { keys, rows: Some(rows) })
    }

    /// Row of the key at `place`.
    pub fn row(&self, place: usize) -> usize {
        self.rows.as_ref().map_or(place, |rows| rows[place] as usize)
    }
}

fn check(coordinates: &[[i32; 4]]) -> Result<(), SparseError> {
    let bad = |c: &[i32; 4]| {
        !(0..BATCHES).contains(&c[0]) || c[1..].iter().any(|x| !(-COORDINATE_LIMIT..=COORDINATE_LIMIT).contains(x))
    };
    let Some(row) = coordinates.iter().position(bad) else { return Ok(()) };
    let [batch, x, y, z] = coordinates[row];
    if !(0..BATCHES).contains(&batch) {
        return Err(SparseError::Batch { row, found: batch });
    }
    Err(SparseError::OutOfRange { row, found: [x, y, z] })
}

/// Checks the size of a table before it is made.
pub(super) fn check_entries(rows: usize, offsets: usize) -> Result<(), SparseError> {
    match rows.checked_mul(offsets).is_some_and(|entries| entries <= MOST_ENTRIES) {
        true => Ok(()),
        false => Err(SparseError::TooMany { rows, offsets }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_hold_their_coordinates_in_order() {
        let limit = COORDINATE_LIMIT;
        let sorted = [[0, -limit, limit, -limit], [0, 0, 0, -1], [0, 0, 0, 0], [0, 0, 1, -limit], [1, -limit, 0, 0]];
        for pair in sorted.windows(2) {
            assert!(pack(pair[0]) < pack(pair[1]), "{pair:?}");
        }
        for c in sorted.into_iter().chain([[BATCHES - 1, limit, limit, limit]]) {
            assert_eq!(unpack(pack(c)), c);
        }
        let moved = pack([3, -limit, 5, limit]).wrapping_add_signed(shift([-15, 7, 15]));
        assert_eq!(unpack(moved), [3, -limit - 15, 12, limit + 15]);
    }

    #[test]
    fn bad_coordinates_are_told() {
        let one = |c| SortedKeys::of(&[[0; 4], c]).unwrap_err().to_string();
        assert!(one([0, 0, i32::MIN, 0]).contains("row 1"), "{}", one([0, 0, i32::MIN, 0]));
        assert_eq!(one([-1, 0, 0, 0]), "row 1 has the batch index -1: expected 0 to 1023");
        let twice = SortedKeys::of(&[[0; 4], [0, 1, 0, 0], [0; 4]]).unwrap_err();
        assert_eq!(twice, SparseError::Duplicate { first: 0, second: 2 });
    }
}
