//! Cameras, times and exposures that contradict each other are found before frames are decoded. Nothing here keeps a
//! scene from loading: a contradiction is repaired or its frames are left out, with a warning.

mod cameras;
mod photos;
mod splits;
mod timing;

use std::path::Path;

use crate::findings::Findings;
use crate::options::LoadOptions;
use crate::raw::RawFrame;

pub(crate) use self::cameras::static_cameras;
pub(crate) use self::photos::one_view_a_photo;
pub(crate) use self::splits::{compare_splits, without_time};
pub use self::timing::frame_interval;
pub(crate) use self::timing::interval_of;

/// Names cameras, drops repeated times, settles exposures, and warns about what disagrees. `frames` are sorted by name
/// and stay so.
pub(crate) fn settle(
    mut frames: Vec<RawFrame>,
    scene: &Path,
    options: &LoadOptions,
    findings: &mut Findings,
) -> Vec<RawFrame> {
    cameras::name_by_pose(&mut frames, findings);
    timing::drop_repeats(&mut frames, scene, findings);
    timing::find_backward(&frames, scene, findings);
    timing::settle_exposures(&mut frames, scene, options, findings);
    cameras::find_strays(&frames, scene, findings);
    cameras::compare(&frames, scene, findings);
    frames
}
