//! What a data set on disk becomes when it is loaded: fixtures are written by the tests themselves.

mod blur_from_frames;
mod check;
mod colmap;
mod colmap_writer;
mod consistency;
mod deblur;
mod dialects;
mod fixtures;
mod foreign;
mod guards;
mod hostile;
mod hostile_priors;
mod image_io;
mod layouts;
mod log;
mod masks;
mod meant;
mod nvfi;
mod odd_names;
mod plural;
mod poses;
mod priors;
mod sparse_views;
mod split;
mod transforms;
mod undistort;
