//! Launches of every kernel by its own host code, on small data.
//!
//! A case returns what its kernels wrote. Sizes are a few cubes, with a part of a cube at the end.

mod numbers;
mod splats;
mod tables;

use cubecl::client::Client;
use gs_kernels::cube::buffer::Buffer;
use gs_kernels::cube::error::CubeError;

use crate::scenes::Random;
pub use numbers::long_scan;

/// A case: its name and its work.
pub type Case = (&'static str, fn(&On) -> Result<Vec<Buffer>, CubeError>);

/// All cases; together they launch every kernel.
pub fn all() -> impl Iterator<Item = &'static Case> {
    numbers::CASES.iter().chain(tables::CASES).chain(splats::CASES)
}

/// Where a case runs.
pub struct On<'a> {
    pub client: &'a Client,
}

impl On<'_> {
    pub fn up(&self, values: &[f32]) -> Buffer {
        Buffer::upload(self.client, "test values", values).expect("upload")
    }

    pub fn up_u32(&self, values: &[u32]) -> Buffer {
        Buffer::upload(self.client, "test values", values).expect("upload")
    }

    /// Numbers in `low..high`.
    pub fn list(&self, seed: u64, len: usize, low: f64, high: f64) -> Buffer {
        self.up(&Random::new(seed).values::<f32>(len, low, high))
    }
}

/// Whole numbers below `below`.
fn whole(seed: u64, len: usize, below: u32) -> Vec<u32> {
    Random::new(seed).values::<f64>(len, 0.0, f64::from(below)).into_iter().map(|x| x as u32).collect()
}
