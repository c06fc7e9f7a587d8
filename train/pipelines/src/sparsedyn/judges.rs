//! Photos as judges of a motion: how far renderings of late times are from what the cameras saw.

use gs_burn::{Gaussians, render};
use gs_datasets::View;
use gs_models::sparsedyn::bodies::fit::late_from;
use gs_models::sparsedyn::bodies::{BodyFrame, Law, LawValues};

use super::{Sparsedyn, Step};
use gs_train::fit::parameters::to_host;
use gs_train::fit::photos::{camera, to_tensor};

/// Late times whose photos judge.
const LATE_TIMES: usize = 3;

/// Times whose photos judge a whole path: a rotation of half a turn shows its phase in six.
const ALL_TIMES: usize = 6;

/// Most photos of a time that judge.
const PHOTOS: usize = 5;

/// Photos of some times.
pub struct Judges<'a> {
    gaussians: &'a Gaussians,
    /// Each time by the clock, and its photos.
    photos: Vec<(f64, Vec<&'a View>)>,
    options: gs_burn::RenderOptions,
}

impl<'a> Judges<'a> {
    /// Photos of the last third of `times`, the first frames of the recording.
    pub fn of(times: &[f64], views: &'a [View], gaussians: &'a Gaussians, at: &Step) -> Self {
        Self::after((late_from(times.len()), LATE_TIMES), times, views, gaussians, at)
    }

    /// Photos of all of `times`.
    pub fn of_all(times: &[f64], views: &'a [View], gaussians: &'a Gaussians, at: &Step) -> Self {
        Self::after((0, ALL_TIMES), times, views, gaussians, at)
    }

    /// Photos of `count` times from frame `first` on, evenly, the last one among them.
    fn after(
        (first, count): (usize, usize),
        times: &[f64],
        views: &'a [View],
        gaussians: &'a Gaussians,
        at: &Step,
    ) -> Self {
        let late = (1..=count).map(|k| first + k * (times.len() - 1 - first) / count);
        let of_frame = |frame: usize| {
            let all = &at.cues.by_frame[frame];
            let step = all.len().div_ceil(PHOTOS).max(1);
            all.iter().step_by(step).map(|index| &views[*index]).collect()
        };
        Self {
            gaussians,
            photos: late.map(|frame| (times[frame], of_frame(frame))).collect(),
            options: at.facts.render_options(&at.config.render, gaussians.sh_degree()),
        }
    }

    /// The mean squared difference of renderings from the photos where these count, 0 to 1; `None` without a photo, or
    /// where it is not finite.
    pub fn error(&self, model: &Sparsedyn) -> Option<f64> {
        let device = self.gaussians.device();
        let times: Vec<f64> = self.photos.iter().map(|(time, _)| *time).collect();
        let moved = model.moved(&model.first_positions(self.gaussians), &times);
        let (mut sum, mut count) = (0.0, 0.0);
        for (moved, (_, photos)) in moved.iter().zip(&self.photos) {
            let scene = model.placed(self.gaussians, moved);
            for view in photos {
                let rendering = render(&scene, &camera(view, &device), &self.options);
                let difference = to_host(rendering.color - to_tensor(view, &view.image.data, 3, &device));
                let counts = |pixel: usize| view.mask.as_ref().is_none_or(|mask| mask[pixel] > 0);
                for (_, rgb) in difference.chunks_exact(3).enumerate().filter(|(pixel, _)| counts(*pixel)) {
                    sum += rgb.iter().map(|x| f64::from(x * x)).sum::<f64>();
                    count += 3.0;
                }
            }
        }
        let mean: f64 = sum / count;
        mean.is_finite().then_some(mean)
    }
}

/// `model` with the moving Gaussians `members` in a body of their own.
pub fn with_one(model: &Sparsedyn, members: &[usize], frame: BodyFrame, values: LawValues) -> Sparsedyn {
    let mut model = model.clone();
    let Some(bodies) = model.bodies.take() else { return model };
    let own = bodies.len() as i32;
    members.iter().for_each(|i| model.frame.labels[*i] = own);
    model.bodies = Some(bodies.extended(&[frame], &[values]));
    model
}

/// `model` with the moving Gaussians `members` at rest.
pub fn with_rest(model: &Sparsedyn, members: &[usize]) -> Sparsedyn {
    with_one(model, members, BodyFrame { centre: [0.0; 3], law: Law::of(&[]) }, LawValues::REST)
}
