//! Flux4D, part by part.

mod unet;
