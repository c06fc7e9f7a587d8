//! PSNR over the horizon: of the scene, and of the scene held as it was at the last time that was seen.

use burn::tensor::Tensor;
use glam::DMat4;
use gs_base::counted;
use gs_datasets::{Split, View};
use serde::Serialize;

use super::renderer::{PredictedScene, pose_of};
use super::{ONE_TIME, strip};
use crate::report::charts::{Chart, Series};
use crate::report::future::strip::Picture;
use gs_train::fit::photos::{colors_of, mask_of, to_tensor};
use gs_train::fit::times::through_time;
use gs_train::fit::told::{MOVING, given_regions};
use gs_train::run::evaluate::PHOTO;
use gs_train::run::metrics::{mean, psnr_counted, psnr_masked};

/// Splits of the future, the first of which is charted: cameras that did not train, then those that did.
const FUTURES: [&str; 2] = [Split::TEST, Split::TEST_SEEN];

/// Times of the seen past in the chart at most: it shows the level from which the future departs.
const SEEN_TIMES: usize = 12;

/// Height below the curves as a share of their own: the legend stands there.
const LEGEND: f64 = 0.6;

/// The scores of the views of one time, dB, each the mean over views.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Moment {
    /// The time.
    pub time: f64,
    /// Views.
    pub views: usize,
    /// PSNR of the scene.
    pub psnr: f64,
    /// PSNR of the last state held; `None` while that time is seen.
    pub held: Option<f64>,
    /// PSNR of the scene over moving parts, where the data set marks them.
    pub moving: Option<f64>,
    /// PSNR of the last state held over moving parts.
    pub held_moving: Option<f64>,
}

/// The means over all views of the future, dB.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gain {
    /// Views.
    pub views: usize,
    /// PSNR of the scene.
    pub psnr: f64,
    /// PSNR of the last state held.
    pub held: f64,
    /// `psnr - held`.
    pub gain: f64,
    /// PSNR of the scene over moving parts.
    pub moving: Option<f64>,
    /// PSNR of the last state held over moving parts.
    pub held_moving: Option<f64>,
    /// The difference of the two.
    pub moving_gain: Option<f64>,
}

/// The scores of a split over time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Horizon {
    /// Name of the split of the future.
    pub split: String,
    /// The last time that was seen.
    pub seen_to: f64,
    /// Times ascending.
    pub moments: Vec<Moment>,
    /// The means over the future.
    pub future: Gain,
}

/// The scores of one view.
#[derive(Debug, Clone, Copy)]
struct Score {
    time: f64,
    model: (f64, Option<f64>),
    held: Option<(f64, Option<f64>)>,
}

impl PredictedScene<'_> {
    /// The horizon on the views after the last time that was seen, up to `until`; `None` without such views.
    pub fn horizon(&self, until: Option<f64>) -> Option<Horizon> {
        FUTURES.iter().find_map(|split| self.horizon_of(split, until))
    }

    /// The same for one split.
    pub fn horizon_of(&self, split: &str, until: Option<f64>) -> Option<Horizon> {
        let [_, end] = self.scene.span()?;
        let future = self.future_views(split, until)?;
        // Only of the held-out cameras is the past held out too.
        let past = if split == Split::TEST { self.past_views() } else { Vec::new() };
        let scores = self.scores(&[past, future].concat(), end);
        let future = gain(&scores)?;
        let moments = scores.chunk_by(|a, b| a.time == b.time).filter_map(moment).collect();
        Some(Horizon { split: split.into(), seen_to: end, moments, future })
    }

    /// Views of a split after the last time that was seen and up to `until`; `None` without any.
    pub fn future_views(&self, split: &str, until: Option<f64>) -> Option<Vec<&View>> {
        let [first, end] = self.scene.span()?;
        let room = ONE_TIME * (end - first);
        let is_future = |time: f64| time > end + room && until.is_none_or(|until| time <= until + room);
        let views = self.photos.split(split)?.iter();
        let views: Vec<&View> = views.filter(|view| view.time.is_some_and(is_future)).collect();
        (!views.is_empty()).then_some(views)
    }

    /// Validation views at a few seen times.
    fn past_views(&self) -> Vec<&View> {
        let views = self.photos.split(Split::VALIDATION).unwrap_or_default();
        let mut times: Vec<f64> = views.iter().filter_map(|view| view.time).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let every = times.len().div_ceil(SEEN_TIMES).max(1);
        let chosen: Vec<f64> = times.into_iter().rev().step_by(every).collect();
        views.iter().filter(|view| view.time.is_some_and(|time| chosen.contains(&time))).collect()
    }

    /// The scores of `views`, times ascending.
    fn scores(&self, views: &[&View], end: f64) -> Vec<Score> {
        let mut views = views.to_vec();
        views.sort_by(|a, b| a.time.unwrap_or(0.0).total_cmp(&b.time.unwrap_or(0.0)));
        let held = self.scene.at(end);
        let mut seen: Vec<(DMat4, Tensor<3>)> = Vec::new();
        let mut scores = Vec::with_capacity(views.len());
        let groups: Vec<&[&View]> = views.chunk_by(|a, b| a.time == b.time).collect();
        let time_of = |views: &[&View]| views[0].time.unwrap_or(0.0);
        let is_measured = |views: &[&View]| views.iter().all(|view| self.measured_scores(view).is_some());
        let times: Vec<f64> = groups.iter().filter(|views| !is_measured(views)).map(|views| time_of(views)).collect();
        let mut scenes = through_time(self.scene, &times);
        for views in groups {
            let time = time_of(views);
            let now = if is_measured(views) { None } else { scenes.next() };
            for view in views {
                let pose = pose_of(view);
                let held = (time > end).then(|| {
                    let known = seen.iter().find(|(c2w, image)| *c2w == view.c2w && fits(image, view));
                    known.map(|(_, image)| image.clone()).unwrap_or_else(|| {
                        let image = self.renderer.image(&held, &pose);
                        seen.push((view.c2w, image.clone()));
                        image
                    })
                });
                let rendered = now.as_ref().map(|now| compared(self.renderer.image(now, &pose), view));
                let model = rendered.or_else(|| self.measured_scores(view)).expect("one of the two");
                scores.push(Score { time, model, held: held.map(|held| compared(held, view)) });
            }
        }
        scores
    }

    /// The scores of a view, whole and over the moving part, where its split was measured against the photos.
    fn measured_scores(&self, view: &View) -> Option<(f64, Option<f64>)> {
        let measured = self.measured.filter(|measured| measured.quality.compared == PHOTO)?;
        let is_own = self.photos.split(&measured.split)?.iter().any(|other| std::ptr::eq(other, view));
        let scores = measured.quality.views.iter().find(|scores| is_own && scores.name == view.name)?;
        Some((scores.scores.psnr, scores.regions.get(MOVING).map(|scores| scores.psnr)))
    }

    /// Predicted frames above the photos of the horizon's split.
    pub fn strip(&self, horizon: &Horizon, until: Option<f64>) -> Option<Picture> {
        Some(strip::strip(self, &self.future_views(&horizon.split, until)?))
    }
}

fn fits(image: &Tensor<3>, view: &View) -> bool {
    image.dims() == [view.height, view.width, 3]
}

/// PSNR of an image of a view, whole and over the marked moving part.
fn compared(image: Tensor<3>, view: &View) -> (f64, Option<f64>) {
    let device = image.device();
    let truth = colors_of(view, &device);
    let mask = mask_of(view, &device);
    let whole = psnr_counted(image.clone(), truth.clone(), mask.clone());
    let moving = given_regions(view).into_iter().find(|region| region.name == MOVING);
    let moving = moving.filter(|region| region.mask.iter().any(|inside| *inside > 0)).map(|region| {
        let inside = to_tensor(view, &region.mask, 1, &device);
        let counts = mask.iter().fold(inside, |inside, mask| inside * mask.clone());
        psnr_masked(image, truth, counts)
    });
    (whole, moving)
}

/// The means over `scores`, at the time of the first; `None` without any.
fn moment(scores: &[Score]) -> Option<Moment> {
    Some(Moment {
        time: scores.first()?.time,
        views: scores.len(),
        psnr: mean(scores.iter().map(|score| score.model.0))?,
        held: mean(scores.iter().filter_map(|score| Some(score.held?.0))),
        moving: mean(scores.iter().filter_map(|score| score.model.1)),
        held_moving: mean(scores.iter().filter_map(|score| score.held?.1)),
    })
}

/// The means over the scores of the future; `None` without any.
fn gain(scores: &[Score]) -> Option<Gain> {
    let future: Vec<Score> = scores.iter().filter(|score| score.held.is_some()).copied().collect();
    let Moment { views, psnr, held, moving, held_moving, .. } = moment(&future)?;
    let held = held?;
    Some(Gain {
        views,
        psnr,
        held,
        gain: psnr - held,
        moving,
        held_moving,
        moving_gain: moving.zip(held_moving).map(|(moving, held)| moving - held),
    })
}

impl Horizon {
    /// PSNR over time, with the end of what was seen.
    pub fn chart(&self) -> Chart {
        let line = |value: fn(&Moment) -> Option<f64>| -> Vec<(f64, f64)> {
            self.moments.iter().filter_map(|moment| Some((moment.time, value(moment)?))).collect()
        };
        let mut series = vec![
            Series::line_and_dots("predicted", line(|moment| Some(moment.psnr))),
            Series::line_and_dots("last seen state held", line(|moment| moment.held)),
        ];
        series.retain(Series::is_visible);
        let values = series.iter().flat_map(|series| series.points()).map(|point| point.1);
        let [least, most] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], y| [a.min(y), b.max(y)]);
        let low = least - LEGEND * (most - least);
        series.push(Series::line("last time seen", vec![(self.seen_to, low), (self.seen_to, most)]));
        let cameras = if self.split == Split::TEST { "cameras that did not train" } else { "training cameras" };
        Chart { title: format!("PSNR over time, {cameras}"), x: "time".into(), y: "PSNR, dB".into(), series }
    }

    /// The means in one line.
    pub fn line(&self) -> String {
        let Gain { views, psnr, held, gain, .. } = self.future;
        let parts = self.future;
        let moving = parts.moving.zip(parts.held_moving).map_or(String::new(), |(moving, held)| {
            format!("; moving parts {moving:.2} dB, held {held:.2} dB, gain {:+.2} dB", moving - held)
        });
        format!(
            "{}: PSNR {psnr:.2} dB over {}, last state held {held:.2} dB, gain over held {gain:+.2} dB{moving}",
            self.split,
            counted(views, "later view")
        )
    }
}
