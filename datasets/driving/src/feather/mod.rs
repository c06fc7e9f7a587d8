//! Feather files (Arrow IPC, file format, version 4 and 5) of flat columns: numbers, booleans and strings, plain or in
//! LZ4 frames.
//!
//! The reader is small on purpose: lengths in a file are held against the bytes that are there before anything is
//! allocated, which a reader of all of Arrow does not do, and it adds no crate to the build.
//!
//! | file | holds |
//! |---|---|
//! | `flat.rs` | FlatBuffers tables, with every offset checked |
//! | `lz4.rs` | LZ4 frames |
//! | `schema.rs` | names and types of columns |
//! | `table.rs` | record batches and their columns |

pub(crate) mod flat;
pub(crate) mod lz4;
pub(crate) mod schema;
pub(crate) mod table;
