//! Rows of a table taken out, and put back. The rows are distinct.

use rayon::prelude::*;

use crate::cpu::Real;

/// Values per task; a task is about 20 microseconds.
const BLOCK: usize = 1 << 15;

/// `out[k, ..] = table[rows[k], ..]`, `[M, columns]`.
///
/// # Panics
/// When a row is not in the table.
pub fn take<F: Real>(table: &[F], columns: usize, rows: &[i32]) -> Vec<F> {
    let mut out = vec![F::ZERO; rows.len() * columns];
    if let Some(some) = BLOCK.checked_div(columns) {
        let some = some.max(1);
        out.par_chunks_mut(some * columns).zip(rows.par_chunks(some)).for_each(|(out, rows)| {
            for (out, row) in out.chunks_exact_mut(columns).zip(rows) {
                out.copy_from_slice(&table[place(*row, columns)]);
            }
        });
    }
    out
}

/// `table[rows[k], ..] += more[k, ..]`, in place.
///
/// # Panics
/// When a row is not in the table.
pub fn add<F: Real>(table: &mut [F], columns: usize, rows: &[i32], more: &[F]) {
    assert_eq!(more.len(), rows.len() * columns, "one row of numbers for each row");
    if columns > 0 {
        for (more, row) in more.chunks_exact(columns).zip(rows) {
            table[place(*row, columns)].iter_mut().zip(more).for_each(|(to, more)| *to += *more);
        }
    }
}

fn place(row: i32, columns: usize) -> std::ops::Range<usize> {
    let start = usize::try_from(row).expect("numbers of rows are not negative") * columns;
    start..start + columns
}
