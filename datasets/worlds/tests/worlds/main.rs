//! Worlds as they are written and read back.

mod deblur;
mod fixtures;
