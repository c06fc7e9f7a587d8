//! How a snippet is shown: with the cameras of its frames, in the snippet's axes and in seconds.

use gs_burn::RenderOptions;
use gs_datasets::View;
use gs_driving::DrivingLog;

use super::host_view::HostView;
use super::prepare::HostSnippet;
use gs_train::run::presentation::{self, Camera, Presentation};

/// Metres to the point around which the viewer turns: a few cars away.
const DISTANCE: f64 = 15.0;

/// Most cameras with a button.
const CAMERAS_MAX: usize = 16;

/// A snippet with the frames between its inputs, then the inputs.
pub fn presentation(host: &HostSnippet, log: &DrivingLog) -> Presentation {
    let some_cameras = |views: &[HostView], split: &str| -> Vec<Camera> {
        let every = views.len().div_ceil(CAMERAS_MAX / 2).max(1);
        views.iter().step_by(every).map(|view| camera(view, split, log)).collect()
    };
    Presentation {
        name: host.name.clone(),
        options: RenderOptions { sh_degree: 0, ..RenderOptions::default() },
        middle: host.middle(),
        cameras: [some_cameras(&host.targets, "held out"), some_cameras(&host.inputs, "inputs")].concat(),
        distance: Some(DISTANCE),
        shutter: None,
        world: glam::DMat4::from_translation(log.origin()) * host.to_world,
    }
}

fn camera(view: &HostView, split: &str, log: &DrivingLog) -> Camera {
    let intrinsics = log.cameras()[view.camera].intrinsics;
    let time = Some(view.seconds);
    presentation::camera(
        &View { name: view.name.clone(), time, ..View::new(view.c2w, intrinsics, view.image.clone()) },
        split,
    )
}
