//! PandaSet: JSON poses, gzipped pickles, JPEG images.
//!
//! | file | holds |
//! |---|---|
//! | `names.rs` | names of folders, cameras and files |
//! | `json.rs` | poses, time stamps and intrinsics |
//! | `describe.rs` | frames, cameras and image files of a sequence |
//! | `sweep.rs`, `cuboids.rs` | pickled sweeps and boxes |
//! | `truth.rs`, `truth_image.rs` | exact labels of the points and pixels of synthetic streets, beside the layout |

pub(crate) mod cuboids;
pub(crate) mod describe;
pub(crate) mod json;
pub(crate) mod names;
pub(crate) mod sweep;
pub(crate) mod truth;
pub(crate) mod truth_image;
