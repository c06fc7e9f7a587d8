//! The table of neighbours: for each output row and each offset of the kernel, the input row there or -1.
//!
//! Offsets of an odd kernel are `-r..=r` on each axis with x fastest, those of an even kernel `0..n` with z fastest,
//! as in other sparse libraries, so that their weights can be loaded. Keys sort with z fastest: the offsets of one
//! column `(x, y)` are consecutive keys, and as the output's keys ascend, so do the places where columns begin. One
//! pass over both lists finds a column.

use rayon::prelude::*;

use super::keys::{LARGEST_KERNEL, SortedKeys, SparseError, check_entries, pack, shift, unpack};

/// Output rows of a task, each of which begins its columns with a binary search.
const CHUNK: usize = 2048;

/// Neighbours of output rows among input rows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Neighbours {
    /// Rows of the input.
    pub inputs: usize,
    /// Rows of the output.
    pub outputs: usize,
    /// Offsets of the kernel.
    pub offsets: usize,
    /// `[outputs, offsets]`: the input row, or -1.
    pub table: Vec<i32>,
}

impl Neighbours {
    /// The table of the transposed operation: for each input row and offset the output row that reads it there.
    ///
    /// # Errors
    /// When the table would exceed one buffer.
    pub fn reversed(&self) -> Result<Self, SparseError> {
        check_entries(self.inputs, self.offsets)?;
        let mut table = vec![-1; self.inputs * self.offsets];
        for (row, neighbours) in self.table.chunks_exact(self.offsets).enumerate() {
            for (k, &from) in neighbours.iter().enumerate().filter(|(_, from)| **from >= 0) {
                // An input row and an offset determine the output row, so nothing is written twice.
                table[from as usize * self.offsets + k] = row as i32;
            }
        }
        Ok(Self { inputs: self.outputs, outputs: self.inputs, offsets: self.offsets, table })
    }
}

/// Neighbours on one set of voxels, `kernel` voxels along an edge; the output's voxels are the input's.
///
/// `coordinates` `[V]` are `[batch, x, y, z]`, in any order, no two alike.
///
/// # Errors
/// When coordinates are out of range or not unique, or the kernel is not odd or too large.
pub fn submanifold(coordinates: &[[i32; 4]], kernel: usize) -> Result<Neighbours, SparseError> {
    let expected = "an odd edge from 1 to 15 and a stride of 1";
    if kernel.is_multiple_of(2) || kernel > LARGEST_KERNEL {
        return Err(SparseError::Kernel { kernel, stride: 1, expected });
    }
    check_entries(coordinates.len(), kernel.pow(3))?;
    let sites = SortedKeys::of(coordinates)?;
    Ok(search(&sites, &sites, 1, kernel))
}

/// Neighbours of coarser voxels: the output's voxels are the distinct `floor(c / stride)` in ascending order, and
/// output voxel `o` reads the input voxels at `o * stride` plus the kernel's offsets.
///
/// Returns the output's coordinates too.
///
/// # Errors
/// When coordinates are out of range or not unique, or kernel or stride are 0 or too large.
pub fn strided(
    coordinates: &[[i32; 4]],
    kernel: usize,
    stride: usize,
) -> Result<(Vec<[i32; 4]>, Neighbours), SparseError> {
    let fits = 1..=LARGEST_KERNEL;
    if !fits.contains(&kernel) || !fits.contains(&stride) {
        return Err(SparseError::Kernel { kernel, stride, expected: "an edge and a stride from 1 to 15" });
    }
    let sites = SortedKeys::of(coordinates)?;
    let step = stride as i32;
    let coarse = |key: &u64| {
        let [batch, x, y, z] = unpack(*key);
        pack([batch, x.div_euclid(step), y.div_euclid(step), z.div_euclid(step)])
    };
    let mut keys: Vec<u64> = sites.keys.par_iter().map(coarse).collect();
    keys.par_sort_unstable();
    keys.dedup();
    check_entries(keys.len(), kernel.pow(3))?;
    let coordinates = keys.par_iter().map(|key| unpack(*key)).collect();
    let neighbours = search(&sites, &SortedKeys { keys, rows: None }, step, kernel);
    Ok((coordinates, neighbours))
}

/// The table of `to` among `from`, both in ascending order.
fn search(from: &SortedKeys, to: &SortedKeys, stride: i32, kernel: usize) -> Neighbours {
    let (outputs, offsets) = (to.keys.len(), kernel.pow(3));
    let mut sorted = vec![-1_i32; outputs * offsets];
    let tasks = sorted.par_chunks_mut(CHUNK * offsets).zip(to.keys.par_chunks(CHUNK));
    tasks.for_each(|(table, keys)| {
        let first = |key: &u64| {
            let [batch, x, y, z] = unpack(*key);
            pack([batch, x * stride, y * stride, z * stride])
        };
        let bases: Vec<u64> = keys.iter().map(first).collect();
        for x in 0..kernel {
            for y in 0..kernel {
                column(from, &bases, [x, y], kernel, table);
            }
        }
    });
    let table = match &to.rows {
        None => sorted,
        Some(rows) => {
            let mut table = vec![-1; sorted.len()];
            for (neighbours, &row) in sorted.chunks_exact(offsets).zip(rows) {
                table[row as usize * offsets..][..offsets].copy_from_slice(neighbours);
            }
            table
        }
    };
    Neighbours { inputs: from.keys.len(), outputs, offsets, table }
}

/// Fills the offsets of one column of the kernel for consecutive output voxels.
fn column(from: &SortedKeys, bases: &[u64], [x, y]: [usize; 2], kernel: usize, table: &mut [i32]) {
    let odd = !kernel.is_multiple_of(2);
    let reach = if odd { kernel / 2 } else { 0 } as i64;
    let low = shift([x as i64 - reach, y as i64 - reach, -reach]);
    let Some(first) = bases.first() else { return };
    let mut place = from.keys.partition_point(|key| *key < first.wrapping_add_signed(low));
    for (base, neighbours) in bases.iter().zip(table.chunks_exact_mut(kernel.pow(3))) {
        let begin = base.wrapping_add_signed(low);
        while place < from.keys.len() && from.keys[place] < begin {
            place += 1;
        }
        for (at, key) in from.keys[place..].iter().enumerate().take(kernel) {
            let z = key - begin;
            if z >= kernel as u64 {
                break;
            }
            let z = z as usize;
            let k = if odd { (z * kernel + y) * kernel + x } else { (x * kernel + y) * kernel + z };
            neighbours[k] = from.row(place + at) as i32;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::sparse_conv::COORDINATE_LIMIT;

    /// A blob of voxels with holes, in an order that is not sorted.
    fn blob() -> Vec<[i32; 4]> {
        let all =
            (0..2).flat_map(|b| (0..7).flat_map(move |x| (0..6).flat_map(move |y| (0..5).map(move |z| [b, x, y, z]))));
        let mut kept: Vec<[i32; 4]> = all
            .filter(|[b, x, y, z]| (x * 5 + y * 3 + z * 7 + b) % 3 != 0)
            .map(|[b, x, y, z]| [b, x - 3, y - 3, z])
            .collect();
        kept.sort_by_key(|[b, x, y, z]| (b * 31 + x * 17 + y * 101 + z * 57).rem_euclid(97));
        kept
    }

    fn brute(input: &[[i32; 4]], output: &[[i32; 4]], stride: i32, kernel: i32) -> Vec<i32> {
        let mut table = Vec::new();
        for o in output {
            for k in 0..kernel.pow(3) {
                let (fast, middle, slow) = (k % kernel, k / kernel % kernel, k / kernel / kernel);
                let r = kernel / 2;
                let offset = if kernel % 2 == 1 { [fast - r, middle - r, slow - r] } else { [slow, middle, fast] };
                let at = [o[0], o[1] * stride + offset[0], o[2] * stride + offset[1], o[3] * stride + offset[2]];
                table.push(input.iter().position(|i| *i == at).map_or(-1, |row| row as i32));
            }
        }
        table
    }

    #[test]
    fn tables_are_those_of_a_search_one_by_one() {
        let blob = blob();
        for kernel in [1, 3, 5] {
            let found = submanifold(&blob, kernel).unwrap();
            assert_eq!(found.table, brute(&blob, &blob, 1, kernel as i32), "kernel {kernel}");
        }
        for (kernel, stride) in [(2, 2), (3, 2), (4, 2), (3, 3), (1, 2)] {
            let (coarse, found) = strided(&blob, kernel, stride).unwrap();
            assert!(coarse.is_sorted());
            assert_eq!(found.table, brute(&blob, &coarse, stride as i32, kernel as i32), "{kernel}, {stride}");
        }
    }

    #[test]
    fn submanifold_tables_are_symmetric() {
        let found = submanifold(&blob(), 3).unwrap();
        let reversed = found.reversed().unwrap();
        for (forward, back) in found.table.chunks(27).zip(reversed.table.chunks(27)) {
            assert!(forward.iter().eq(back.iter().rev()));
        }
    }

    #[test]
    fn voxels_at_the_limit_have_no_neighbour_on_the_other_side() {
        let limit = COORDINATE_LIMIT;
        let corners: Vec<[i32; 4]> = (0..8)
            .map(|i| {
                [
                    0,
                    if i & 1 == 0 { -limit } else { limit },
                    if i & 2 == 0 { -limit } else { limit },
                    if i & 4 == 0 { -limit } else { limit },
                ]
            })
            .collect();
        let found = submanifold(&corners, 15).unwrap();
        assert_eq!(found.table.iter().filter(|row| **row >= 0).count(), 8);
        let (coarse, found) = strided(&corners, 15, 15).unwrap();
        assert_eq!(coarse.len(), 8);
        assert_eq!(found.table, brute(&corners, &coarse, 15, 15));
        assert!(submanifold(&[[0, limit + 1, 0, 0]], 3).is_err());
    }

    #[test]
    fn no_voxel_and_one_voxel() {
        assert!(submanifold(&[], 3).unwrap().table.is_empty());
        let (coarse, found) = strided(&[], 2, 2).unwrap();
        assert!(coarse.is_empty() && found.table.is_empty() && found.reversed().unwrap().table.is_empty());
        let mut alone = vec![-1; 27];
        alone[13] = 0;
        assert_eq!(submanifold(&[[0, 4, 5, 6]], 3).unwrap().table, alone);
        assert!(submanifold(&[], 2).is_err() && submanifold(&[], 17).is_err() && strided(&[], 0, 2).is_err());
    }
}
