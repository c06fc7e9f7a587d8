//! Scenes as PLY files in the layout of 3DGS, which other viewers and trainers read.
//!
//! A vertex is a Gaussian: `x y z`, `nx ny nz` (zeros), `f_dc_0..2`, `f_rest_*` (coefficients above degree 0, channel
//! by channel), `opacity` (before the sigmoid), `scale_0..2` (logarithms), `rot_0..3` (w x y z). Written as
//! little-endian binary; read also as big-endian binary or text, with properties in any order and any others beside
//! them.
//!
//! A comment `SplatRenderMode: default` or `mip` says whether small Gaussians are brightened by the blur of a pixel;
//! PlayCanvas' and other programs write and read it. The compressed PLY of PlayCanvas (chunks of 256 Gaussians) is
//! read. Harmonics of degree 4 are read up to degree 3.
//!
//! A scene far from its world's origin has local positions and a comment `SplatOffset: x y z`, which is added to each
//! of them.

mod compressed;
mod read;
mod source;
#[cfg(test)]
mod tests;
mod write;

pub use read::{PlyScene, read};
pub use write::{encoded_len, write};

/// The render mode that the comment `SplatRenderMode` of a file says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SplatRenderMode {
    /// `default`: as in 3DGS, small Gaussians are brightened by the blur of a pixel.
    Default,
    /// `mip`: trained with the compensation of Mip-Splatting, to be drawn with it.
    Mip,
    /// `2dgs`: flat Gaussians with an intersection of their own.
    Flat,
}

impl SplatRenderMode {
    fn word(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::Mip => "mip",
            Self::Flat => "2dgs",
        }
    }

    fn of_word(word: &str) -> Option<Self> {
        [Self::Default, Self::Mip, Self::Flat].into_iter().find(|mode| mode.word() == word)
    }
}

/// The name in the comment.
const RENDER_MODE: &str = "SplatRenderMode:";

/// The name of the comment with the offset, three numbers.
const OFFSET: &str = "SplatOffset:";

/// Coefficients above degree 0 that a file may hold per channel: those of degrees 0 to 4.
const REST_PER_CHANNEL: [usize; 5] = [0, 3, 8, 15, 24];

/// Most coefficients above degree 0 per channel that a scene holds: those of degree 3. More in a file are left out.
const REST_KEPT: usize = 15;

/// Names of the properties of a Gaussian in a file with `rest` coefficients per channel above degree 0, in the order of
/// the packed record that reader and writer share: means, quats, log_scales, opacity logit, sh `[S, 3]`.
fn record_names(rest: usize) -> Vec<String> {
    let fixed = ["x", "y", "z", "rot_0", "rot_1", "rot_2", "rot_3", "scale_0", "scale_1", "scale_2", "opacity"];
    let dc = ["f_dc_0", "f_dc_1", "f_dc_2"];
    let names = fixed.into_iter().chain(dc).map(str::to_owned);
    // The file goes channel by channel, memory coefficient by coefficient.
    let kept = 0..rest.min(REST_KEPT);
    let rest = kept.flat_map(|k| (0..3).map(move |channel| format!("f_rest_{}", channel * rest + k)));
    names.chain(rest).collect()
}

/// Values of a record before the spherical harmonics.
const RECORD_MEANS: std::ops::Range<usize> = 0..3;
const RECORD_QUATS: std::ops::Range<usize> = 3..7;
const RECORD_LOG_SCALES: std::ops::Range<usize> = 7..10;
const RECORD_OPACITY: usize = 10;
const RECORD_SH: usize = 11;
