//! Parquet files: the crate `parquet` decodes metadata, levels and values; this module checks sizes before it does.
//!
//! The crate's own page reader takes the memory that a header asks for and unpacks a stream to its end: a page of some
//! kilobytes could fill the machine. So pages are found, measured and unpacked here.
//!
//! | file | holds |
//! |---|---|
//! | `thrift.rs` | a walk over footers and page headers |
//! | `codec.rs` | unpacking within bounds |
//! | `pages.rs` | pages of a column chunk |
//! | `table.rs` | a file and its columns |

mod codec;
mod pages;
pub(crate) mod table;
mod thrift;
