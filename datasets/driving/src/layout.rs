//! Names and writers of the files of a log in the layout of PandaSet, and of the exact truth that synthetic streets
//! have beside it.

pub use crate::gzip::compress;
pub use crate::pandaset::names::{CAMERA, CAMERAS, CUBOIDS, LIDAR, SEMSEG, TRUTH_POINTS};
pub use crate::pandaset::truth::{COLUMNS as TRUTH_COLUMNS, track};
pub use crate::pandaset::truth_image::{encode_truth_image, truth_image_file};
pub use crate::pickle::write::{Column, table};
