//! Values: hand-computed numbers, twin against twin, hostile input, equality to the bit.

mod adam;
mod channels;
mod exposure;
mod frustum;
mod hostile;
mod intersect;
mod noise;
mod opacity;
mod products;
mod projection;
mod rasterize;
mod render;
mod reproducible;
mod rows;
mod sh;
mod silu;
mod sparse_conv;
mod ssim;
mod statistics;
mod sum;
