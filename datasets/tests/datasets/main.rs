//! What a data set on disk becomes when it is loaded: fixtures are written by the tests themselves.

mod check;
mod colmap;
mod fixtures;
mod hostile;
mod image_io;
mod masks;
mod motion;
mod poses;
mod split;
mod transforms;
mod undistort;
