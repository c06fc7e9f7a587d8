//! `[eval]` and `[checkpoint]`: the steps at which a training is measured and saved.

use serde::{Deserialize, Serialize};

use super::error::{ConfigError, check};

/// When and how the scene is measured.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EvalConfig {
    /// Steps after which the held-out views are measured, beside the last one.
    pub at: Vec<usize>,
    /// Held-out views of which side-by-side pictures are kept at the end.
    pub images: usize,
    /// Whether MS-SSIM is measured (some seconds per view on a CPU).
    pub ms_ssim: bool,
    /// Whether LPIPS is measured, in a build with the feature `lpips`, if Burn's cache has its weights.
    pub lpips: bool,
}

impl Default for EvalConfig {
    fn default() -> Self {
        Self { at: Vec::new(), images: 4, ms_ssim: true, lpips: true }
    }
}

/// When the state is saved.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CheckpointConfig {
    /// Steps from one checkpoint to the next, and so the most that a killed run loses; 0: only at the end.
    pub every: usize,
    /// Checkpoints kept; older ones are removed once a new one is complete. With 2, `--resume` can go on from the older one if the
    /// newest is damaged; with 1 the work would be lost.
    pub keep: usize,
}

impl Default for CheckpointConfig {
    fn default() -> Self {
        Self { every: 1000, keep: 2 }
    }
}

impl EvalConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        check("eval.images", self.images, self.images <= 1000, "at most 1000")
    }
}

impl CheckpointConfig {
    /// Checks every range.
    ///
    /// # Errors
    /// The first value outside its range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        check("checkpoint.keep", self.keep, self.keep >= 1, "at least 1")
    }
}
