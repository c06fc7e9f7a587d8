//! TaylorMoDe-GS: sharp moving scenes from motion-blurred multi-view video.
//!
//! | paper | here |
//! |---|---|
//! | 3.2 Taylor motion and velocity (Eq. 2, 3), velocity splatting (Eq. 4), remainder (Eq. 5) | `gs_models::taylormode`, [`velocity`]; lent to a step by [`state`] |
//! | 3.3 blur synthesis (Eq. 6 to 12) | [`step`]: `warped`; the exact formation: `integrated`, with [`blur`] |
//! | 3.4 losses (Eq. 13 to 19), gradient decoupling | [`step`], weights in [`config`] |
//! | 4.1 masks, depth, pseudo-sharp photos, optimisers | [`hints`], [`init`], [`first_points`], [`first_paths`], [`learned`] |
//! | beyond the paper: what moves, moves mostly as one | [`collective`] |
//! | beyond the paper: no more motion than a scene needs | [`select`], judged by [`likelihood`] |
//! | measuring on sharp ground truth | [`measure`] |

pub mod blur;
pub mod collective;
pub mod config;
pub mod first_paths;
pub mod first_points;
pub mod hints;
pub mod init;
pub mod learned;
pub mod likelihood;
pub mod measure;
pub mod saved;
pub mod select;
pub mod state;
pub mod step;
pub mod tracks;
pub mod velocity;

use crate::experiment::Config;
use crate::schedule::exponential;
use crate::taylormode::config::BlurMode;
use crate::taylormode::state::{MotionRates, MotionState};

/// Steps over which the rates of motion rise to their full size, linearly.
const WARM_UP: f64 = 100.0;

/// At most this share of a run is spent on that.
const WARM_UP_SHARE: f64 = 0.1;

/// Whether the photos have a say in the exposure at all: it is learned at some time, by a blur that is formed and compared.
pub fn learns_exposure(state: &MotionState, config: &Config) -> bool {
    let blur = &config.blur;
    let compared = match blur.mode {
        BlurMode::None => false,
        BlurMode::Warp => config.prior.blur > 0.0,
        BlurMode::Integrate => true,
    };
    blur.learn_exposure && compared && !(state.exposure_said && blur.exposure_from >= 1.0)
}

/// The rates of a step; `extent` in scene units.
pub fn rates(state: &MotionState, config: &Config, step: usize, extent: f64) -> MotionRates {
    let (motion, blur) = (&config.motion, &config.blur);
    // Adam's first steps have full length in every block whatever the gradient: together they would throw a path across the scene.
    let warm = (step as f64 / WARM_UP.min(WARM_UP_SHARE * config.steps as f64).max(1.0)).min(1.0);
    let decay = warm * exponential(1.0, motion.final_share, step, config.steps);
    let held = if state.exposure_said { (blur.exposure_from * config.steps as f64) as usize } else { 0 };
    let exposure = match blur.learn_exposure && step > held {
        true => blur.exposure_lr * exponential(1.0, motion.final_share, step - held, config.steps - held),
        false => 0.0,
    };
    MotionRates {
        position: motion.position_lr * decay * extent,
        rotation: motion.rotation_lr * decay,
        exposure,
        network: blur.network_lr,
        remainder: motion.remainder_lr * decay,
    }
}
