//! Files as other programs write and read them, and damaged ones.

#[path = "../../../tests/fuzz/bounded.rs"]
mod bounded;
mod fuzz_ply;
#[path = "../../../../tests/src/mutate.rs"]
mod mutate;
mod python;
