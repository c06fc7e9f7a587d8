//! Flux4D (arXiv 2512.03210): a network that turns a driving log into moving Gaussians.
//!
//! | part of the paper | folder |
//! |---|---|
//! | sparse 3D UNet (Fig. A1) | [`unet`] |

pub mod unet;
