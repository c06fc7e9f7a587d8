//! Photos as judges of a motion: how far renderings are from what the cameras saw.

use gs_burn::{Gaussians, render};
use gs_datasets::View;
use gs_models::sparsedyn::bodies::{Bodies, Body};

use super::{Sparsedyn, Step};
use gs_train::fit::parameters::to_host;
use gs_train::fit::photos::camera;

/// Times whose photos judge.
const TIMES: usize = 5;

/// Most photos of a time that judge.
const PHOTOS: usize = 5;

/// Largest difference of two renderings that is none: two steps of an 8-bit photo. A body on a few pixels is judged by
/// these, and not by what all candidates have in common.
const SAME: f32 = 2.0 / 255.0;

/// Independent values that the photos count as beside the poses: what the logarithm of their error weighs. Of 20
/// choices on five worlds, right laws had at least 13 % less error than laws that the poses took for better by up to
/// 19.
pub const PHOTOS_WEIGHT: f64 = 150.0;

/// Least error of photos: that of rounding to 8 bits.
const ROUNDING: f64 = 1.0 / (255.0 * 255.0 * 12.0);

/// The evidence of an error of the photos against a motion: twice the negative logarithm of the likelihood up to a
/// constant; 0 where photos say nothing.
pub fn said(error: Option<f64>) -> f64 {
    PHOTOS_WEIGHT * error.map_or(0.0, |error| error.max(ROUNDING).ln())
}

/// Photos of some times.
pub struct Judges<'a> {
    gaussians: &'a Gaussians,
    /// Each time by the clock, and its photos.
    photos: Vec<(f64, Vec<&'a View>)>,
    options: gs_burn::RenderOptions,
}

impl<'a> Judges<'a> {
    /// Photos of some of `times` after frame `first`, evenly, the last one among them.
    pub fn after(first: usize, times: &[f64], views: &'a [View], gaussians: &'a Gaussians, at: &Step) -> Self {
        let last = times.len().saturating_sub(1).max(first);
        let mut frames: Vec<usize> = (1..=TIMES).map(|k| first + k * (last - first) / TIMES).collect();
        frames.dedup();
        frames.retain(|frame| *frame > first || last == first);
        let of_frame = |frame: usize| {
            let all = &at.cues.by_frame[frame];
            let step = all.len().div_ceil(PHOTOS).max(1);
            all.iter().step_by(step).map(|index| &views[*index]).collect()
        };
        Self {
            gaussians,
            photos: frames.into_iter().map(|frame| (times[frame], of_frame(frame))).collect(),
            options: at.facts.render_options(&at.config.render, gaussians.sh_degree()),
        }
    }

    /// [`Self::errors`] of `model` with its moving Gaussians `members` in each of `bodies` instead of their own.
    pub fn errors_of(
        &self,
        model: &Sparsedyn,
        members: &[usize],
        bodies: impl Iterator<Item = Body>,
    ) -> Vec<Option<f64>> {
        let known = model.bodies.as_ref().map(Bodies::all).unwrap_or_default();
        let mut model = model.clone();
        members.iter().for_each(|i| model.frame.labels[*i] = known.len() as i32);
        let trial = |body: Body| {
            let all = [known.as_slice(), &[body]].concat();
            model.clone().with_all(&all, &self.gaussians.device())
        };
        self.errors(&bodies.map(trial).collect::<Vec<_>>())
    }

    /// The mean squared difference of each model's renderings from the photos, 0 to 1, where these count and two of the
    /// models differ, infinite where it is not finite; `None` without such a pixel.
    fn errors(&self, models: &[Sparsedyn]) -> Vec<Option<f64>> {
        let mut sums = vec![0.0; models.len()];
        let mut count = 0.0;
        for (time, photos) in &self.photos {
            let moved = |model: &Sparsedyn| {
                let moved = model.moved(&model.first_positions(self.gaussians), &[*time]).remove(0);
                model.placed(self.gaussians, &moved)
            };
            let scenes: Vec<Gaussians> = models.iter().map(moved).collect();
            for view in photos {
                let camera = camera(view, &self.gaussians.device());
                let drawn: Vec<Vec<f32>> =
                    scenes.iter().map(|scene| to_host(render(scene, &camera, &self.options).color)).collect();
                let counts = |pixel: usize| view.mask.as_ref().is_none_or(|mask| mask[pixel] > 0);
                for index in (0..view.image.data.len()).filter(|index| counts(index / 3) && differ(&drawn, *index)) {
                    for (sum, drawn) in sums.iter_mut().zip(&drawn) {
                        *sum += (f64::from(drawn[index]) - f64::from(view.image.data[index]) / 255.0).powi(2);
                    }
                    count += 1.0;
                }
            }
        }
        let mean = |sum: f64| if sum.is_finite() { sum / count } else { f64::INFINITY };
        sums.into_iter().map(|sum| (count > 0.0).then(|| mean(sum))).collect()
    }
}

/// Whether two images differ in a value by more than [`SAME`].
fn differ(images: &[Vec<f32>], index: usize) -> bool {
    let values = images.iter().map(|image| image[index]);
    let (low, high) = values.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    high - low > SAME
}
