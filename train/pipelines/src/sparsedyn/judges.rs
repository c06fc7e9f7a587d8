//! Photos as judges of a motion: how far renderings are from what the cameras saw. Before they judge a law, its numbers
//! are fitted to them: poses err together by a pixel, and a right law with numbers from the poses looks as wrong as
//! another.

use gs_burn::adam::AdamRate;
use gs_burn::{Gaussians, render};
use gs_datasets::View;
use gs_models::sparsedyn::bodies::{Bodies, Body};

use super::{Sparsedyn, Step};
use gs_train::fit::parameters::to_host;
use gs_train::fit::photos::{camera, colors_of, mask_of};
use gs_train::fit::schedule::exponential;
use gs_train::fit::training::Training;

/// Times whose photos judge.
const TIMES: usize = 5;

/// Times to whose photos a law's numbers are fitted: every third frame of a recording as long as the paper's.
const TIMES_FITTED: usize = 16;

/// Updates of a law's numbers before photos judge it, and their learning rates at the first and the last, in the unit
/// of lengths of the bodies and in radians. Together they reach 0.08, some pixels.
const UPDATES: usize = 60;
const RATES: [f64; 2] = [4e-3, 2e-4];

/// The step from one photo to the next of all times in turn, a share of them: the golden section.
const GOLDEN: f64 = 0.618_033_988_749_895;

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
        Self::of(TIMES, first, times, views, gaussians, at)
    }

    /// Photos of `times` from first to last, to which laws are fitted.
    pub fn of_all_times(times: &[f64], views: &'a [View], gaussians: &'a Gaussians, at: &Step) -> Self {
        Self::of(TIMES_FITTED, 0, times, views, gaussians, at)
    }

    fn of(count: usize, first: usize, times: &[f64], views: &'a [View], gaussians: &'a Gaussians, at: &Step) -> Self {
        let last = times.len().saturating_sub(1).max(first);
        let mut frames: Vec<usize> = (1..=count).map(|k| first + k * (last - first) / count).collect();
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
        let known = known(model);
        self.errors(&bodies.map(|body| self.with(&known, model, members, body)).collect::<Vec<_>>())
    }

    /// `model`, whose bodies are `known`, with its moving Gaussians `members` in `body`, its last one.
    fn with(&self, known: &[Body], model: &Sparsedyn, members: &[usize], body: Body) -> Sparsedyn {
        let mut model = model.clone();
        members.iter().for_each(|i| model.frame.labels[*i] = known.len() as i32);
        model.with_all(&[known, &[body]].concat(), &self.gaussians.device())
    }

    /// The scene at a time.
    fn moved(&self, model: &Sparsedyn, time: f64) -> Gaussians {
        let moved = model.moved(&model.first_positions(self.gaussians), &[time]).remove(0);
        model.placed(self.gaussians, &moved)
    }

    /// `body` of the Gaussians `members`, its law's numbers after [`UPDATES`] updates by these photos; as it was where
    /// an update is not finite.
    pub fn refined(&self, model: &Sparsedyn, members: &[usize], body: Body) -> Body {
        let device = self.gaussians.device();
        let mut training = Training::new(self.with(&known(model), model, members, body.clone()));
        for update in 1..=UPDATES {
            let (time, photos) = &self.photos[((GOLDEN * update as f64).fract() * self.photos.len() as f64) as usize];
            let view = photos[update % photos.len()];
            let loss = |model: &Sparsedyn| {
                let image = render(&self.moved(model, *time), &camera(view, &device), &self.options).color;
                let difference = (image - colors_of(view, &device)).abs();
                mask_of(view, &device).map_or(difference.clone(), |mask| difference * mask).mean()
            };
            let rate = AdamRate::new(exponential(RATES[0], RATES[1], update, UPDATES));
            training.descend(loss, |path| (path == "bodies.numbers").then_some(rate));
        }
        known(training.module()).pop().filter(|refined| refined.values.0.iter().all(|x| x.is_finite())).unwrap_or(body)
    }

    /// The mean squared difference of each model's renderings from the photos, 0 to 1, where these count and two of the
    /// models differ, infinite where it is not finite; `None` without such a pixel.
    fn errors(&self, models: &[Sparsedyn]) -> Vec<Option<f64>> {
        let mut sums = vec![0.0; models.len()];
        let mut count = 0.0;
        for (time, photos) in &self.photos {
            let scenes: Vec<Gaussians> = models.iter().map(|model| self.moved(model, *time)).collect();
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

/// The bodies of a model.
fn known(model: &Sparsedyn) -> Vec<Body> {
    model.bodies.as_ref().map(Bodies::all).unwrap_or_default()
}

/// Whether two images differ in a value by more than [`SAME`].
fn differ(images: &[Vec<f32>], index: usize) -> bool {
    let values = images.iter().map(|image| image[index]);
    let (low, high) = values.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    high - low > SAME
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, Tensor, TensorData};
    use gs_burn::RenderOptions;
    use gs_burn::glam::DVec3;
    use gs_models::sparsedyn::bodies::{BodyFrame, Law, LawValues, Term};

    use super::super::begin::at_rest;
    use super::super::config::defaults;
    use super::*;

    /// Rows of blobs, 0.3 apart, 4 before a camera that looks along z.
    fn blobs(device: &Device) -> Gaussians {
        let tensor = |values: Vec<f32>, shape: [usize; 2]| Tensor::from_data(TensorData::new(values, shape), device);
        let mean = |i: usize| [0.3 * (i % 3) as f32 - 0.3, 0.3 * (i / 3) as f32 - 0.3, 4.0];
        let color = |i: usize| [(i % 2) as f32 - 0.5, (i % 3) as f32 - 1.0, 1.0 - (i / 3) as f32];
        Gaussians::from_tensors(
            tensor((0..9).flat_map(mean).collect(), [9, 3]),
            tensor([1.0, 0.0, 0.0, 0.0].repeat(9), [9, 4]),
            tensor(vec![0.1_f32.ln(); 27], [9, 3]),
            Tensor::full([9], 3.0, device),
            tensor((0..9).flat_map(color).collect(), [9, 3]).reshape([9, 1, 3]),
        )
    }

    /// Numbers that are off by half a pixel at the last time come within a quarter of a pixel of those that made the
    /// photos.
    #[test]
    fn a_law_is_fitted_to_photos() {
        let device = gs_burn::device::select("auto").expect("a device");
        let gaussians = blobs(&device);
        let mut model = at_rest(&defaults(), &device);
        (model.frame.rows, model.frame.labels) = ((0..9).collect(), vec![-1; 9]);
        let members: Vec<usize> = (0..9).collect();
        let moving = |speed: f64| {
            let mut values = LawValues::REST;
            values.set(Term::Velocity, DVec3::new(speed, 0.0, 0.0));
            Body::of(BodyFrame::of([0.0, 0.0, 4.0], Law::of(&[Term::Velocity]), 0.0), values)
        };
        let mut judges = Judges { gaussians: &gaussians, photos: Vec::new(), options: RenderOptions::default() };
        let (truth, mut views) = (judges.with(&[], &model, &members, moving(0.4)), Vec::new());
        for time in [0.25, 0.5, 0.75, 1.0] {
            let mut view = View::blank(48, 48);
            let drawn = render(&judges.moved(&truth, time), &camera(&view, &device), &judges.options).color;
            view.image.data = to_host(drawn).iter().map(|x| (255.0 * x).round().clamp(0.0, 255.0) as u8).collect();
            views.push((time, view));
        }
        judges.photos = views.iter().map(|(time, view)| (*time, vec![view])).collect();
        let pixel = 4.0 / 48.0;
        let refined = judges.refined(&model, &members, moving(0.4 + 0.5 * pixel));
        let off = refined.values.vector(Term::Velocity).distance(DVec3::new(0.4, 0.0, 0.0));
        assert!(off < 0.25 * pixel, "off by {} pixels", off / pixel);
        let errors = judges.errors_of(&model, &members, [moving(0.4 + 0.5 * pixel), refined].into_iter());
        // The error goes by the square of what is off.
        assert!(errors[1] < errors[0].map(|error| 0.25 * error), "{errors:?}");
    }
}
