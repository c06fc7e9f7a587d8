//! Device buffers of four-byte values, and how a launch is cut into cubes.

use std::sync::atomic::{AtomicUsize, Ordering};

use cubecl::prelude::*;
use cubecl::server::Handle;

use crate::cube::error::CubeError;

/// Largest buffer on any device: graphics APIs count the bytes of a binding in signed 32-bit numbers.
const MAX_BYTES: u64 = i32::MAX as u64;

/// Largest buffer of a device: what its driver allocates at once, and what a kernel binds at once.
pub fn most_bytes(client: &Client) -> u64 {
    client.properties().memory.max_page_size.min(MAX_BYTES)
}

/// # Errors
/// When `bytes` exceed [`most_bytes`].
fn check_bytes(client: &Client, what: &'static str, bytes: u64) -> Result<(), CubeError> {
    let most = most_bytes(client);
    if bytes > most { Err(CubeError::BufferTooLarge { what, bytes, most }) } else { Ok(()) }
}

/// Units of a one-dimensional cube.
pub const UNITS: usize = 256;

/// Most cubes along one axis of a launch.
const MAX_CUBES_PER_AXIS: usize = 65_535;

/// Parts of a buffer begin at multiples of this many values (256 bytes, the strictest binding alignment in use).
const PART_ALIGNMENT: usize = 64;

/// Calls of [`Buffer::download`] in this process.
static DOWNLOADS: AtomicUsize = AtomicUsize::new(0);

/// How often a kernel's host code has waited for a number of its device, in this process: a tool for tests.
pub fn downloads() -> usize {
    DOWNLOADS.load(Ordering::Relaxed)
}

/// A contiguous run of `f32`, `i32` or `u32` values on the device.
#[derive(Clone, Debug)]
pub struct Buffer {
    handle: Handle,
    len: usize,
}

impl Buffer {
    /// Room for `len` values, not initialised; `what` names them in an error.
    ///
    /// # Errors
    /// When the buffer would exceed [`most_bytes`].
    pub fn empty(client: &Client, what: &'static str, len: usize) -> Result<Self, CubeError> {
        check_bytes(client, what, len as u64 * 4)?;
        // No API binds zero bytes.
        let handle = client.empty((len * 4).max(4));
        Ok(Self { handle, len })
    }

    /// One allocation cut into parts of the given lengths: one binding where a kernel has many outputs.
    ///
    /// # Errors
    /// When the whole would exceed [`most_bytes`].
    pub fn slab<const P: usize>(client: &Client, what: &'static str, lens: [usize; P]) -> Result<Slab<P>, CubeError> {
        let mut starts = [0; P];
        let mut end = 0;
        for (start, len) in starts.iter_mut().zip(lens) {
            *start = end;
            end += len.max(1).next_multiple_of(PART_ALIGNMENT);
        }
        let whole = Self::empty(client, what, end)?;
        let parts = std::array::from_fn(|k| whole.part(starts[k], lens[k]));
        Ok(Slab { whole, starts, parts })
    }

    /// A buffer over a tensor's memory.
    ///
    /// # Panics
    /// When `handle` is shorter than `len` values.
    pub fn from_handle(client: &Client, handle: Handle, len: usize) -> Self {
        let bytes = handle.size_in_used();
        assert!(bytes >= len as u64 * 4, "memory of {bytes} bytes cannot hold {len} values");
        // An empty tensor's memory may have no byte, which no API binds.
        let handle = if len == 0 { client.empty(4) } else { handle };
        Self { handle, len }
    }

    /// Uploads `values`.
    ///
    /// # Errors
    /// When they exceed [`most_bytes`].
    pub fn upload<T: CubeElement>(client: &Client, what: &'static str, values: &[T]) -> Result<Self, CubeError> {
        let bytes = T::as_bytes(values);
        check_bytes(client, what, bytes.len() as u64)?;
        let handle = client.create_from_slice(if bytes.is_empty() { &[0; 4] } else { bytes });
        Ok(Self { handle, len: values.len() })
    }

    /// Reads all values back; waits for the device.
    ///
    /// # Errors
    /// When the device has failed.
    pub fn download<T: CubeElement + Clone>(&self, client: &Client) -> Result<Vec<T>, CubeError> {
        DOWNLOADS.fetch_add(1, Ordering::Relaxed);
        let bytes = client.read_one(self.handle.clone()).map_err(|error| CubeError::Device(error.to_string()))?;
        Ok(T::from_bytes(&bytes)[..self.len].to_vec())
    }

    /// `len` values from `start` on.
    pub(crate) fn part(&self, start: usize, len: usize) -> Self {
        let used = self.handle.size_in_used();
        let (begin, bytes) = (start as u64 * 4, (len as u64 * 4).max(4));
        let handle = self.handle.clone().offset_start(begin).offset_end(used - begin - bytes);
        Self { handle, len }
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is no value.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The memory, for a tensor.
    pub fn into_handle(self) -> Handle {
        self.handle
    }

    /// The buffer as a kernel's argument.
    pub fn arg(&self) -> BufferArg {
        // SAFETY: every constructor checks that the handle holds `len` values of four bytes.
        unsafe { BufferArg::from_raw_parts(self.handle.clone(), self.len.max(1)) }
    }
}

/// One allocation and its parts; see [`Buffer::slab`].
pub struct Slab<const P: usize> {
    /// All of it.
    pub whole: Buffer,
    /// Offset of each part in the whole, in values.
    pub starts: [usize; P],
    /// The parts.
    pub parts: [Buffer; P],
}

/// A grid of at least `cubes` cubes that keeps every axis within the limit. The kernel checks `CUBE_POS` itself.
pub fn grid(cubes: usize) -> CubeCount {
    let rows = cubes.div_ceil(MAX_CUBES_PER_AXIS).max(1);
    CubeCount::Static(cubes.div_ceil(rows) as u32, rows as u32, 1)
}

/// A grid with one unit of a [`UNITS`]-wide cube for each of `items`.
pub fn grid_for(items: usize) -> CubeCount {
    grid(items.div_ceil(UNITS))
}

/// The cube of [`grid_for`].
pub fn cube_dim() -> CubeDim {
    CubeDim::new_1d(UNITS as u32)
}
