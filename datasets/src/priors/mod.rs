//! Files beside a photo: what other programs guessed about it (priors) and, of synthetic worlds, the truth.
//!
//! ```text
//! sources.rs    which files belong to a photo: JSON keys, or side folders
//! depth.rs      numbers -> depth: what they mean, which of them are unknown
//! attach.rs     all of a photo's files at training size, or why one is left out
//! summary.rs    the sentences about many photos
//! ```
//!
//! No file here can keep a scene from loading: a prior that is missing, broken or of another shape than its photo is
//! left out for that photo and counted, because every prior is optional to the methods that use it.

pub(crate) mod attach;
pub(crate) mod depth;
pub(crate) mod sources;
pub(crate) mod summary;
