//! The background of a static camera: the picture without passing objects.

use gs_base::statistics::median_by;
use rayon::prelude::*;

use gs_datasets::{RgbImage8, View};

use crate::cameras::StaticCamera;
use crate::cluster::{Cluster, Pixel, classify, distance2};
use crate::illumination::LightLimits;
use crate::noise::Noise;
use crate::options::MaskOptions;
use crate::pixels::{color, counts, median_color};

/// Two colours differ from this squared distance on, over the variance of the noise: five standard deviations.
const OTHER: f32 = 25.0;

/// A background needs this many samples of a pixel. Of two different ones either may be the background.
pub(crate) const SAMPLES_MIN: usize = 3;

/// Largest ratio of a pixel's noise to the usual noise of its brightness. Compressed video flickers along edges; more
/// than that is motion.
const FLICKER: f32 = 3.0;

/// The median over time of the channels' mean |difference|, over the noise's standard deviation: sqrt(4 / pi).
const MEAN_DIFFERENCE: f32 = 1.128;

/// The picture of a static camera without passing objects.
#[derive(Debug, Clone, PartialEq)]
pub struct Background {
    /// Colour of each pixel; the median over time where `known` is false.
    pub image: RgbImage8,
    /// `[height, width]`: whether one colour returns often enough to be the background.
    pub known: Vec<bool>,
}

/// The background of a static camera; `None` with fewer than three views, or when they differ in size.
///
/// The background of a pixel is the colour that returns most often, not the median (see `cluster.rs`): a textured
/// object may cover a pixel most of the time without harm. A background that shows for less than a fifth of the time
/// is not found. An object of one colour that rests for most of the time is taken for background.
pub fn background(views: &[View], camera: &StaticCamera, options: &MaskOptions) -> Option<Background> {
    let model = BackgroundModel::new(views, camera, options)?;
    let (width, height) = model.size;
    let mut data = Vec::with_capacity(3 * width * height);
    for (pixel, mean) in model.mean.iter().enumerate() {
        let over_time = || camera.views.iter().map(|index| color(&views[*index], pixel)).collect::<Vec<_>>();
        data.extend(match model.state[pixel] {
            State::Stable => mean.map(|value| value.round().clamp(0.0, 255.0) as u8),
            _ => median_color(&over_time()).expect("a static camera has views"),
        });
    }
    let known = model.state.iter().map(|state| *state == State::Stable).collect();
    Some(Background { image: RgbImage8 { width, height, data }, known })
}

/// State of a pixel's background.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum State {
    /// One colour returns.
    Stable,
    /// No colour returns: something moves here all the time.
    Unstable,
    /// The views' own masks leave too few samples.
    Masked,
}

/// Background colour and noise of each pixel of a static camera.
pub(crate) struct BackgroundModel {
    pub size: (usize, usize),
    /// Colour, levels of 255.
    pub mean: Vec<[f32; 3]>,
    pub state: Vec<State>,
    /// Standard deviation of a channel's noise, levels of 255.
    pub deviation: Vec<f32>,
    /// Whether the background's colour is often seen on passing objects, so that a pixel of it may be an object's.
    pub doubtful: Vec<bool>,
    /// Standard deviation of the noise over the whole image, levels of 255.
    pub noise: f32,
    /// Limits of light on the background.
    pub light: LightLimits,
}

impl BackgroundModel {
    /// `None` with fewer than [`SAMPLES_MIN`] views or with buffers of another size than the view states.
    pub fn new(views: &[View], camera: &StaticCamera, options: &MaskOptions) -> Option<Self> {
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
        let stable = |pixel: usize| match &pixels[pixel] {
            (Pixel::Stable(cluster), deviation) => Some((cluster.mean, *deviation)),
            _ => None,
        };
        let appearance = Appearance::new(views, camera, noise.overall, options, stable);
        let (mut mean, mut state) = (Vec::with_capacity(pixels.len()), Vec::with_capacity(pixels.len()));
        for (pixel, _) in &pixels {
            let (color, known) = match pixel {
                Pixel::Masked => ([0.0; 3], State::Masked),
                Pixel::Unstable => ([0.0; 3], State::Unstable),
                Pixel::Stable(cluster) => (cluster.mean, State::Stable),
                Pixel::Ambiguous(likely, other) => (appearance.choose(likely, other), State::Stable),
            };
            mean.push(color);
            state.push(known);
        }
        let deviation: Vec<f32> = pixels.iter().map(|(_, deviation)| *deviation).collect();
        let known = |pixel: usize| (state[pixel] == State::Stable).then(|| (mean[pixel], deviation[pixel]));
        let appearance = Appearance::new(views, camera, noise.overall, options, known);
        let doubtful = (0..mean.len()).map(|i| state[i] == State::Stable && appearance.may_pass(mean[i])).collect();
        Some(Self {
            size,
            mean,
            state,
            deviation,
            doubtful,
            noise: noise.overall,
            light: LightLimits::scaled(options.shadow),
        })
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
        // Colours are grouped by the usual noise: a texture that turns would pass for noise of the pixel's own.
        (classify(&samples, usual, SAMPLES_MIN, &mut scratch), own)
    })
    .collect()
}

/// Noise of a pixel: the usual one of its brightness, and its own, which is larger where the pixel flickers, within
/// [`FLICKER`].
fn pixel_deviation(samples: &[[u8; 3]], noise: &Noise, steps: &mut Vec<u16>) -> (f32, f32) {
    steps.clear();
    steps
        .extend(samples.windows(2).map(|pair| (0..3).map(|c| u16::from(pair[0][c].abs_diff(pair[1][c]))).sum::<u16>()));
    let level: u32 = samples.iter().flatten().map(|value| u32::from(*value)).sum();
    let usual = noise.at(level as f32 / (3 * samples.len().max(1)) as f32);
    let Some(step) = median_by(steps, u16::cmp) else { return (usual, usual) };
    let own = f32::from(step) / 3.0 / MEAN_DIFFERENCE;
    (usual, own.clamp(usual, FLICKER * usual))
}

/// Counts of each colour on passing objects and on the background, at pixels whose background is certain.
///
/// The counts decide ambiguous pixels: near the start or end of an object's path the object's colour and the
/// background's both return, and only the rest of the picture tells which is which. They also find doubtful pixels:
/// an object that moves by less than its own width never uncovers its middle, but its moving edges show the same
/// colour.
struct Appearance {
    passing: Vec<u32>,
    staying: Vec<u32>,
    options: MaskOptions,
}

impl Appearance {
    /// `known` returns a pixel's background colour and noise where they are certain.
    fn new(
        views: &[View],
        camera: &StaticCamera,
        noise: f32,
        options: &MaskOptions,
        known: impl Fn(usize) -> Option<([f32; 3], f32)> + Sync,
    ) -> Self {
        let bits = options.color_bits;
        let bins = 1 << (3 * bits);
        let light = LightLimits::scaled(options.shadow);
        let count = |index: &usize| {
            let mut counts = (vec![0; bins], vec![0; bins]);
            for pixel in 0..views[*index].width * views[*index].height {
                let Some((mean, deviation)) = known(pixel) else { continue };
                let sample = color(&views[*index], pixel);
                // Five standard deviations away and not a shadow: certainly a passing object.
                let differs = distance2(&sample, &mean) > OTHER * deviation * deviation;
                let passes = differs && !light.is_light(&sample, &mean, deviation, noise);
                let counts = if passes { &mut counts.0 } else { &mut counts.1 };
                counts[bin(sample.map(f32::from), bits)] += 1;
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
        Self { passing, staying, options: *options }
    }

    /// Chooses the background's colour among two.
    fn choose(&self, likely: &Cluster, other: &Cluster) -> [f32; 3] {
        let shares = [&self.staying, &self.passing].map(|counts| counts.iter().sum::<u32>().max(1) as f32);
        // One part in a thousand is added, so that the ratio of two rare colours stays near 1.
        let share = |counts: &[u32], total: f32, color: [f32; 3]| {
            counts[bin(color, self.options.color_bits)] as f32 / total + 1e-3
        };
        let ratio = |color: [f32; 3]| share(&self.staying, shares[0], color) / share(&self.passing, shares[1], color);
        if ratio(other.mean) > self.options.overturn as f32 * ratio(likely.mean) { other.mean } else { likely.mean }
    }

    /// Whether a background colour is also a common colour of passing objects.
    fn may_pass(&self, color: [f32; 3]) -> bool {
        let bin = bin(color, self.options.color_bits);
        self.passing[bin] as f32 > self.options.doubtful as f32 * self.staying[bin] as f32
    }
}

/// Index of a colour among those of `bits` a channel.
fn bin(color: [f32; 3], bits: u32) -> usize {
    color.iter().fold(0, |bin, value| (bin << bits) | (value.clamp(0.0, 255.0) as usize >> (8 - bits)))
}
