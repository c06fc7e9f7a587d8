//! `[eval]` and `[checkpoint]`: the steps at which a training is measured and saved.

use crate::section;

section! {
    /// When and how the scene is measured.
    #[derive(Eq)]
    pub struct EvalConfig {
        /// Steps after which the held-out views are measured, beside the last one.
        at: Vec<usize> = Vec::new();
        /// Held-out views of which side-by-side pictures are kept at the end.
        images: usize = 4, in ..=1000;
        /// Whether MS-SSIM is measured (some seconds per view on a CPU).
        ms_ssim: bool = true;
        /// Whether LPIPS is measured, in a build with the feature `lpips`, if Burn's cache has its weights.
        lpips: bool = true;
    }
}

section! {
    /// When the state is saved.
    #[derive(Eq)]
    pub struct CheckpointConfig {
        /// Steps from one checkpoint to the next, and so the most that a killed run loses; 0: only at the end.
        every: usize = 1000;
        /// Checkpoints kept; older ones are removed once a new one is complete. With 2, `--resume` can go on from the
        /// older one if the newest is damaged; with 1 the work would be lost.
        keep: usize = 2, in 1..;
    }
}
