//! Training steps for `gsburn bench`: the middle of a run, on one photo and without a data set.

use gs_burn::{Camera, Gaussians, RenderOptions, render};

use super::facts::SceneFacts;
use super::method::Method;
use super::photos::Photo;
use super::trainer::{Model, Trainer};
use crate::config::FitConfig;

/// Steps of the run, and the one that is taken next: every schedule is in its middle.
const RUN: (usize, usize) = (1_000_000, 5000);

/// A training in the middle of its run; each call is one step.
pub type Steps = Box<dyn FnMut()>;

/// A photo that is the scene's rendering with less contrast.
pub fn photo_of<X>(gaussians: &Gaussians, camera: &Camera, extra: X) -> Photo<X> {
    let image = render(gaussians, camera, &RenderOptions::default()).color * 0.5 + 0.25;
    Photo {
        camera: camera.clone(),
        image,
        mask: None,
        time: 0.0,
        pixel: 1.0,
        share: 1.0,
        index: 0,
        color: None,
        path: None,
        extra,
    }
}

/// The middle of a run whose density control keeps the count.
pub fn steps<M: Method>(model: Model<M>, photo: Photo<M::Extra>, mut config: FitConfig<M::Config>) -> Steps
where
    M::Cues: Default,
{
    config.shared.steps = RUN.0;
    config.shared.model.sh_degree = model.gaussians.sh_degree();
    config.shared.density.start = config.shared.steps;
    let facts = SceneFacts::unknown(&config);
    let mut trainer = Trainer::from_model(model, facts, &config);
    trainer.step = RUN.1;
    let (photos, cues) = ([photo], M::Cues::default());
    Box::new(move || drop(trainer.step(&photos, &[], &cues, &config)))
}
