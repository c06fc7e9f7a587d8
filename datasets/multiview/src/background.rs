//! What a standing camera sees when nothing passes.

use rayon::prelude::*;

use gs_datasets::{RgbImage8, View};

use crate::cameras::StaticCamera;
use crate::cluster::{Cluster, Pixel, classify, distance2};
use crate::illumination::is_light;
use crate::median::median;
use crate::noise::Noise;
use crate::pixels::{color, counts};

/// Squared distance of a mean colour from which on it is another one, in squares of its standard deviation: five of them.
const OTHER: f32 = 25.0;

/// Fewest samples of a pixel from which a background is told: with two, nobody knows which of them it is.
pub(crate) const SAMPLES_MIN: usize = 3;

/// A pixel may be this much noisier than others of its brightness before it is called moving: compressed video
/// flickers along edges.
const FLICKER: f32 = 3.0;

/// The median over time of the channels' mean |difference|, over the noise's standard deviation: sqrt(4 / pi).
const MEAN_DIFFERENCE: f32 = 1.128;

/// Bits of each channel by which colours are counted as alike in [`Appearance`].
const COLOR_BITS: u32 = 4;

/// How many times likelier a colour must be to overturn the order in which a torn pixel's colours come.
const OVERTURNS: f32 = 4.0;

/// A colour is doubtful when it is seen on what passes this often for each time it is seen on what stays.
const DOUBTFUL: f32 = 0.3;

/// The picture of a standing camera without passing objects.
#[derive(Debug, Clone, PartialEq)]
pub struct Background {
    /// Colour per pixel; the median over time where no colour stays.
    pub image: RgbImage8,
    /// `[height, width]`: whether one colour stays, so that `image` shows what is static.
    pub known: Vec<bool>,
}

/// The background of a standing camera; `None` with fewer than three views, or when they differ in size.
///
/// Per pixel it is the colour that is seen again and again, not the median: see `cluster.rs`. A textured object
/// may cover a pixel most of the time without harm. What does not show the background for a fifth of the time cannot be
/// known; an object of one colour that rests somewhere for most of the time is taken for background there.
pub fn background(views: &[View], camera: &StaticCamera) -> Option<Background> {
    let plate = Plate::new(views, camera)?;
    let (width, height) = plate.size;
    let mut data = Vec::with_capacity(3 * width * height);
    for (pixel, mean) in plate.mean.iter().enumerate() {
        let color = if plate.state[pixel] == State::Known { *mean } else { median_color(views, camera, pixel) };
        data.extend(color.map(|value| value.round().clamp(0.0, 255.0) as u8));
    }
    let known = plate.state.iter().map(|state| *state == State::Known).collect();
    Some(Background { image: RgbImage8 { width, height, data }, known })
}

/// What is known of a pixel's background.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum State {
    /// One colour stays.
    Known,
    /// No colour stays: always moving.
    Restless,
    /// The views' own masks leave too few samples.
    Unseen,
}

/// Background and noise per pixel.
pub(crate) struct Plate {
    pub size: (usize, usize),
    /// Colour, levels of 255.
    pub mean: Vec<[f32; 3]>,
    pub state: Vec<State>,
    /// Standard deviation of a channel's noise, levels of 255.
    pub deviation: Vec<f32>,
    /// Whether the background has a colour here that is often seen on what passes.
    pub doubtful: Vec<bool>,
    /// The usual noise over the image.
    pub noise: f32,
}

impl Plate {
    /// `None` with fewer than [`SAMPLES_MIN`] views or images whose size is not what they say.
    pub fn new(views: &[View], camera: &StaticCamera) -> Option<Self> {
        let first = views.get(*camera.views.first()?)?;
        let size = (first.width, first.height);
        let fits = |index: &usize| {
            views.get(*index).is_some_and(|view| {
                let keep = view.mask.as_ref().is_none_or(|mask| mask.len() == size.0 * size.1);
                (view.width, view.height) == size && view.image.data.len() == 3 * size.0 * size.1 && keep
            })
        };
        if camera.views.len() < SAMPLES_MIN || size.0 * size.1 == 0 || !camera.views.iter().all(fits) {
            return None;
        }
        let noise = Noise::of(views, camera);
        let rows: Vec<Vec<(Pixel, f32)>> = (0..size.1)
            .into_par_iter()
            .map(|y| classify_row(views, camera, &noise, y * size.0..(y + 1) * size.0))
            .collect();
        let pixels: Vec<(Pixel, f32)> = rows.into_iter().flatten().collect();
        let settled = |pixel: usize| match &pixels[pixel] {
            (Pixel::Settled(cluster), deviation) => Some((cluster.mean, *deviation)),
            _ => None,
        };
        let appearance = Appearance::new(views, camera, noise.overall, settled);
        let (mut mean, mut state) = (Vec::with_capacity(pixels.len()), Vec::with_capacity(pixels.len()));
        for (pixel, _) in &pixels {
            let (color, known) = match pixel {
                Pixel::Unseen => ([0.0; 3], State::Unseen),
                Pixel::Restless => ([0.0; 3], State::Restless),
                Pixel::Settled(cluster) => (cluster.mean, State::Known),
                Pixel::Torn(likely, other) => (appearance.choose(likely, other), State::Known),
            };
            mean.push(color);
            state.push(known);
        }
        let deviation: Vec<f32> = pixels.iter().map(|(_, deviation)| *deviation).collect();
        let known = |pixel: usize| (state[pixel] == State::Known).then(|| (mean[pixel], deviation[pixel]));
        let appearance = Appearance::new(views, camera, noise.overall, known);
        let doubtful = (0..mean.len()).map(|i| state[i] == State::Known && appearance.may_pass(mean[i])).collect();
        Some(Self { size, mean, state, deviation, doubtful, noise: noise.overall })
    }
}

fn classify_row(
    views: &[View],
    camera: &StaticCamera,
    noise: &Noise,
    row: std::ops::Range<usize>,
) -> Vec<(Pixel, f32)> {
    let (mut samples, mut steps, mut scratch) = (Vec::new(), Vec::new(), Vec::new());
    row.map(|pixel| {
        samples.clear();
        samples.extend(
            camera.views.iter().map(|i| &views[*i]).filter(|view| counts(view, pixel)).map(|view| color(view, pixel)),
        );
        let (usual, own) = pixel_deviation(&samples, noise, &mut steps);
        // Which colours stay is judged by the usual noise: with its own, a texture that turns would pass for noise.
        (classify(&samples, usual, SAMPLES_MIN, &mut scratch), own)
    })
    .collect()
}

/// A pixel's noise: what its brightness has, and that or more where it flickers from frame to frame, within
/// [`FLICKER`].
fn pixel_deviation(samples: &[[u8; 3]], noise: &Noise, steps: &mut Vec<u16>) -> (f32, f32) {
    steps.clear();
    steps
        .extend(samples.windows(2).map(|pair| (0..3).map(|c| u16::from(pair[0][c].abs_diff(pair[1][c]))).sum::<u16>()));
    let level: u32 = samples.iter().flatten().map(|value| u32::from(*value)).sum();
    let usual = noise.at(level as f32 / (3 * samples.len().max(1)) as f32);
    let Some(step) = median(steps, u16::cmp) else { return (usual, usual) };
    let own = f32::from(step) / 3.0 / MEAN_DIFFERENCE;
    (usual, own.clamp(usual, FLICKER * usual))
}

/// The median over time, per channel.
fn median_color(views: &[View], camera: &StaticCamera, pixel: usize) -> [f32; 3] {
    [0, 1, 2].map(|c| {
        let mut values: Vec<u8> = camera.views.iter().map(|i| views[*i].image.data[3 * pixel + c]).collect();
        f32::from(median(&mut values, u8::cmp).expect("a static camera has views"))
    })
}

/// How often each colour is seen on what passes and on what stays, at pixels where the two are told apart.
///
/// It decides the torn pixels: near where an object of one colour starts or ends, its colour and the background's both
/// stay for a while, and only the rest of the picture knows which is the object's. And it finds doubtful ones: an
/// object that moves by less than its width never uncovers its middle, but the colour there is that of its moving
/// edges.
struct Appearance {
    passing: Vec<u32>,
    staying: Vec<u32>,
}

impl Appearance {
    /// `known` gives a pixel's background colour and noise where they are certain.
    fn new(
        views: &[View],
        camera: &StaticCamera,
        noise: f32,
        known: impl Fn(usize) -> Option<([f32; 3], f32)> + Sync,
    ) -> Self {
        let bins = 1 << (3 * COLOR_BITS);
        let count = |index: &usize| {
            let mut counts = (vec![0; bins], vec![0; bins]);
            for pixel in 0..views[*index].width * views[*index].height {
                let Some((mean, deviation)) = known(pixel) else { continue };
                let sample = color(&views[*index], pixel);
                // Five standard deviations, and not its shadow: certainly not the background.
                let differs = distance2(&sample, &mean) > OTHER * deviation * deviation;
                let passes = differs && !is_light(&sample, &mean, deviation, noise);
                let counts = if passes { &mut counts.0 } else { &mut counts.1 };
                counts[bin(sample.map(f32::from))] += 1;
            }
            counts
        };
        let none = || (vec![0; bins], vec![0; bins]);
        let add = |mut a: (Vec<u32>, Vec<u32>), b: (Vec<u32>, Vec<u32>)| {
            a.0.iter_mut().zip(b.0).for_each(|(a, b)| *a += b);
            a.1.iter_mut().zip(b.1).for_each(|(a, b)| *a += b);
            a
        };
        let (passing, staying) = camera.views.par_iter().map(count).reduce(none, add);
        Self { passing, staying }
    }

    /// The background's colour of the two.
    fn choose(&self, likely: &Cluster, other: &Cluster) -> [f32; 3] {
        let shares = [&self.staying, &self.passing].map(|counts| counts.iter().sum::<u32>().max(1) as f32);
        // One part in a thousand for colours never seen, so that a ratio of two rare colours says nothing.
        let share = |counts: &[u32], total: f32, color: [f32; 3]| counts[bin(color)] as f32 / total + 1e-3;
        let ratio = |color: [f32; 3]| share(&self.staying, shares[0], color) / share(&self.passing, shares[1], color);
        if ratio(other.mean) > OVERTURNS * ratio(likely.mean) { other.mean } else { likely.mean }
    }

    /// Whether a colour of the background is seen on passing things for a good part of the times it is seen.
    fn may_pass(&self, color: [f32; 3]) -> bool {
        self.passing[bin(color)] as f32 > DOUBTFUL * self.staying[bin(color)] as f32
    }
}

fn bin(color: [f32; 3]) -> usize {
    color.iter().fold(0, |bin, value| (bin << COLOR_BITS) | (value.clamp(0.0, 255.0) as usize >> (8 - COLOR_BITS)))
}
