//! Files beside a photo, by kind: priors, which are guesses, and the truth. [`priors`](crate::priors) finds and reads
//! them.

use std::fmt;
use std::path::PathBuf;

use crate::options::DepthKind;

/// The content of a file beside a photo.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Kind {
    Depth,
    Confidence,
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
        matches!(self, Self::Depth | Self::Confidence | Self::Moving | Self::Sharp)
    }

    /// Bytes of a pixel in memory.
    pub fn bytes(self) -> usize {
        match self {
            Self::Moving | Self::TrueMoving | Self::TrueMovingUnion => 1,
            Self::Sharp | Self::TrueSharp | Self::TrueBlurry => 3,
            Self::Depth | Self::Confidence | Self::TrueDepth => 4,
            Self::TrueVelocity => 12,
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Depth => "depth priors",
            Self::Confidence => "confidences of depth",
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

/// The meaning of the numbers in depth files, as a data set says it.
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
