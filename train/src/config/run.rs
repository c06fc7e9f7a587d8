//! `[eval]` and `[checkpoint]`: when a training is measured and saved.

use serde::{Deserialize, Serialize};

use super::error::{ConfigError, check};

/// When and how the result is measured.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EvalConfig {
    /// Steps after which the held-out views are measured; the last step always is.
    pub at: Vec<usize>,
    /// Held-out views kept as side-by-side pictures at the end.
    pub images: usize,
    /// Whether MS-SSIM is measured (some seconds a view on a CPU).
    pub ms_ssim: bool,
    /// Whether LPIPS is measured where Burn's cache has its weights.
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
    /// Steps from one checkpoint to the next, which is also what a killed run loses at most; 0: only at the end.
    pub every: usize,
    /// Checkpoints kept; older ones are removed once a new one is whole.
    pub keep: usize,
}

impl Default for CheckpointConfig {
    fn default() -> Self {
        Self { every: 1000, keep: 1 }
    }
}

impl EvalConfig {
    pub(super) fn validate(&self) -> Result<(), ConfigError> {
        check("eval.images", self.images, self.images <= 1000, "at most 1000")
    }
}

impl CheckpointConfig {
    pub(super) fn validate(&self) -> Result<(), ConfigError> {
        check("checkpoint.keep", self.keep, self.keep >= 1, "at least 1")
    }
}
