//! `[eval]` and `[checkpoint]`: the steps at which a training is measured and saved.

use crate::section;

section! {
    /// When and how the scene is measured.
    #[derive(Eq)]
    pub struct EvalConfig {
        /// Steps after which the held-out views are measured, beside the last one.
        at: Vec<usize> = Vec::new();
        /// Held-out views of which side-by-side pictures are kept.
        images: usize = 4, in ..=1000;
        /// Whether MS-SSIM is measured; seconds a view on a CPU.
        ms_ssim: bool = true;
        /// Whether LPIPS is measured, in a build with the feature `lpips` and with its weights in Burn's cache.
        lpips: bool = true;
    }
}

section! {
    /// When the state is saved.
    #[derive(Eq)]
    pub struct CheckpointConfig {
        /// Steps from one checkpoint to the next: the most that a killed run loses. 0: at the end alone.
        every: usize = 1000;
        /// Checkpoints kept. With 2, `--resume` goes on from the older one where the newest is damaged.
        keep: usize = 2, in 1..;
    }
}
