//! The experiments and the comparisons as they are used.

mod comparison;
mod flux4d;
mod sparsedyn;
mod taylormode;

use burn::tensor::Device;
use gs_burn::device::{BACKENDS, select};

/// Names the backend that the tests use; without it they use the first of the build.
const TEST_DEVICE: &str = "GSBURN_TEST_DEVICE";

/// The device of the tests.
fn device() -> Device {
    let first = BACKENDS.into_iter().find(|kind| kind.is_built()).expect("a backend is built").name();
    let name = std::env::var(TEST_DEVICE).unwrap_or_else(|_| first.into());
    select(&name).unwrap_or_else(|error| panic!("{name}: {error}"))
}
