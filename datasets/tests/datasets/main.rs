//! What a data set on disk becomes when it is loaded: fixtures are written by the tests themselves.

mod blur_from_frames;
mod check;
mod colmap;
mod deblur;
mod fixtures;
mod hostile;
mod image_io;
mod masks;
mod poses;
mod split;
mod transforms;
mod undistort;
