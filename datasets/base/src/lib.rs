//! The ground under the other crates: files, sentences, and small sums, one of each. It knows nothing of tensors,
//! scenes or training.
//!
//! | module | holds |
//! |---|---|
//! | [`guarded`] | reading of files that somebody else wrote: regular files, within a limit |
//! | [`atomic`] | writing of files that are whole or not there |
//! | [`ply`], [`npy`] | the header of PLY files; NumPy arrays |
//! | [`FileError`] | a mistake of a file in one sentence |
//! | [`sentence`] | printable names, numbers and counts in messages |
//! | [`Intrinsics`] | a pinhole camera's focal lengths and principal point |
//! | [`local`] | positions far from the origin of their world |
//! | [`statistics`] | mean, median, range |
//! | [`eigen`], [`dense`], [`mod@least_squares`], [`polar`] | small dense systems in f64 |

pub mod atomic;
pub mod dense;
pub mod eigen;
mod error;
pub mod guarded;
mod intrinsics;
pub mod least_squares;
pub mod local;
pub mod npy;
pub mod ply;
pub mod polar;
pub mod sentence;
pub mod statistics;

pub use atomic::write_atomic;
pub use error::FileError;
pub use intrinsics::Intrinsics;
pub use sentence::{agree, clause, counted, printable};
pub use statistics::{mean, median};
