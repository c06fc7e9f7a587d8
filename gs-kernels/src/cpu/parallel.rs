//! Distribution of work over threads with results that do not depend on it.

use std::marker::PhantomData;

/// Items per task of a sum over all items: fixed, so that the order of partial sums does not depend on the number of
/// threads.
pub const CHUNK: usize = 2048;

/// A mutable slice that several tasks write in ranges that do not overlap (pixels of different tiles).
pub(crate) struct Disjoint<'a, T> {
    start: *mut T,
    len: usize,
    slice: PhantomData<&'a mut [T]>,
}

// SAFETY: tasks only write through `slice_mut`, whose caller promises that ranges do not overlap.
unsafe impl<T: Send> Sync for Disjoint<'_, T> {}
// SAFETY: as above.
unsafe impl<T: Send> Send for Disjoint<'_, T> {}

impl<'a, T> Disjoint<'a, T> {
    /// Shares `slice` among tasks.
    pub(crate) fn new(slice: &'a mut [T]) -> Self {
        Self { start: slice.as_mut_ptr(), len: slice.len(), slice: PhantomData }
    }

    /// The range `start..start + len`.
    ///
    /// # Safety
    /// No two live ranges may overlap.
    #[inline(always)]
    #[allow(clippy::mut_from_ref)] // the very purpose: the caller promises that ranges do not overlap
    pub(crate) unsafe fn slice_mut(&self, start: usize, len: usize) -> &mut [T] {
        assert!(start + len <= self.len, "range {start}..{} of {}", start + len, self.len);
        // SAFETY: inside the slice by the assertion, alone in its range by the caller's promise.
        unsafe { std::slice::from_raw_parts_mut(self.start.add(start), len) }
    }
}

/// A vector of `len` zeros. Large ones come from the system already zeroed and cost nothing until they are touched.
pub(crate) fn zeros<F: crate::cpu::Real>(len: usize) -> Vec<F> {
    vec![F::ZERO; len]
}

/// Asks the processor to fetch `values[index]`, which is read soon; does nothing without such an instruction.
#[inline(always)]
pub(crate) fn prefetch<T>(values: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    if let Some(value) = values.get(index) {
        // SAFETY: a prefetch reads nothing architecturally, and the address is valid.
        unsafe {
            std::arch::x86_64::_mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T0 }>(std::ptr::from_ref(value).cast());
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (values, index);
}
