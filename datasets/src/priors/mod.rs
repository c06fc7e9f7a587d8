//! Files beside a photo: what other programs guessed about it (priors) and, of synthetic worlds, the truth.
//!
//! ```text
//! sources.rs    which files belong to a photo: JSON keys, or side folders
//! npy.rs        NumPy arrays          }
//! exr.rs        OpenEXR channels      } bytes -> numbers, whatever they mean
//! map.rs        a raster of one kind, its size, the nearest pixel at another size
//! depth.rs      numbers -> depth: what they mean, which of them are unknown
//! attach.rs     all of a photo's files at training size, or why one is left out
//! summary.rs    the sentences about many photos
//! ```
//!
//! No file here can keep a scene from loading: a prior that is missing, broken or of another shape than its photo is
//! left out for that photo and counted, because every prior is optional to the methods that use it.

pub(crate) mod attach;
mod depth;
mod exr;
mod map;
pub(crate) mod npy;
pub(crate) mod sources;
pub(crate) mod summary;

use std::fmt;
use std::path::PathBuf;

use crate::options::DepthKind;

/// What a file beside a photo holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Kind {
    Depth,
    Moving,
    Sharp,
    TrueSharp,
    TrueBlurry,
    TrueDepth,
    TrueVelocity,
    TrueMoving,
    TrueMovingUnion,
}

impl Kind {
    /// Whether it is a guess rather than the truth.
    pub fn is_prior(self) -> bool {
        matches!(self, Self::Depth | Self::Moving | Self::Sharp)
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Depth => "depth priors",
            Self::Moving => "masks of moving objects",
            Self::Sharp => "pseudo-sharp images",
            Self::TrueSharp => "true sharp images",
            Self::TrueBlurry => "true blurry images",
            Self::TrueDepth => "true depth maps",
            Self::TrueVelocity => "true velocity maps",
            Self::TrueMoving => "true masks",
            Self::TrueMovingUnion => "true masks over the exposure",
        })
    }
}

/// A file beside a photo. `path` is `None` where other photos of the set have one and this photo has none.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SideFile {
    pub kind: Kind,
    pub path: Option<PathBuf>,
}

/// What a data set says about the numbers in its depth files.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DepthMeaning {
    /// `None` where it does not say.
    pub kind: Option<DepthKind>,
    /// Scene units per step of a 16-bit file of metric depth.
    pub step: f64,
}

impl Default for DepthMeaning {
    fn default() -> Self {
        Self { kind: None, step: MILLIMETRE }
    }
}

/// nerfstudio's unit of depth in 16-bit files: 1/1000 of a metre.
const MILLIMETRE: f64 = 1e-3;

/// All files beside one photo.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct SideFiles {
    pub files: Vec<SideFile>,
    pub depth: DepthMeaning,
}

impl SideFiles {
    /// Whether a kind is listed, with or without a file.
    pub fn lists(&self, kind: Kind) -> bool {
        self.files.iter().any(|file| file.kind == kind)
    }
}
