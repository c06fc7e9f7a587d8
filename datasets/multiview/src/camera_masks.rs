//! Masks of moving pixels from the photos of a static camera: pixels that differ from the background by more than
//! noise and shadow.

use rayon::prelude::*;

use gs_datasets::View;

use crate::background::{BackgroundModel, SAMPLES_MIN, State};
use crate::cameras::StaticCamera;
use crate::cluster::{MEMBER, distance2};
use crate::options::MaskOptions;
use crate::pixels::{color, counts};
use crate::regions::{close_gaps, drop_specks, fill_holes, grow, join};
use crate::shadow::Light;

/// Fewest views of a static camera from which masks are made.
pub const FRAMES_MIN: usize = SAMPLES_MIN;

/// Largest score of one pixel. The score is the squared difference from the background over the variance of the
/// noise; the cap (five standard deviations) keeps one broken pixel from deciding for its neighbours.
const SCORE_MAX: f32 = 25.0;

/// A pixel moves when the mean score of its 3 x 3 neighbourhood reaches this. Noise has a mean score of 3 with a
/// standard deviation of 0.8. At a straight edge half of the neighbourhood must move, so masks keep their size. A
/// change of twice the noise in every channel suffices.
const SCORE_STRONG: f32 = 12.0;

/// A pixel beside a moving one moves when its neighbourhood reaches this (noise plus five standard deviations) and
/// the pixel itself [`SCORE_ALONE`].
const SCORE_WEAK: f32 = 7.0;

/// Score that a pixel needs on its own to join a neighbour: three standard deviations. With less the mask would grow
/// by a pixel all around.
const SCORE_ALONE: f32 = 9.0;

/// Smallest region at any resolution, pixels: about the 3 x 3 neighbourhood of a score, so that one chance score is
/// none.
const SPECK_MIN: usize = 8;

/// Masks inferred from the photos of one static camera.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraMasks {
    /// For each of the camera's views, in its order: `[height, width]`, 255 where something moves.
    pub masks: Vec<Vec<u8>>,
    /// Estimated standard deviation of the sensor's noise, levels of 255.
    pub noise: f32,
}

/// Masks of moving pixels in the views of a static camera. `None` with fewer than [`FRAMES_MIN`] views, so for
/// cameras that move.
///
/// Limits: in blurry photos the mask covers the pixels that the object touched during the exposure, down to a share
/// of the exposure that drowns in the noise. The part of an object that never uncovers its background is found by its
/// texture, or by its colour where that is rare in the background. A surface that darkens and has no texture passes
/// for a shadow unless moving pixels enclose it.
pub fn camera_masks(views: &[View], camera: &StaticCamera, options: &MaskOptions) -> Option<CameraMasks> {
    let model = BackgroundModel::new(views, camera, options)?;
    let frames: Vec<&View> = camera.views.iter().map(|index| &views[*index]).collect();
    let shown: Vec<Shown> = (0..model.mean.len()).into_par_iter().map(|pixel| shown(&model, &frames, pixel)).collect();
    let masks =
        (0..frames.len()).into_par_iter().map(|frame| moving(&model, &frames, &shown, frame, options)).collect();
    Some(CameraMasks { masks, noise: model.noise })
}

/// Indices of the first, middle and last frame that show the background's colour at a pixel; `None` if none does.
type Shown = Option<[u32; 3]>;

fn shown(model: &BackgroundModel, frames: &[&View], pixel: usize) -> Shown {
    let (mean, variance) = (&model.mean[pixel], model.deviation[pixel] * model.deviation[pixel]);
    let shows = |view: &View| counts(view, pixel) && distance2(&color(view, pixel), mean) <= MEMBER * variance;
    let all: Vec<u32> = (0..).zip(frames).filter(|(_, view)| shows(view)).map(|(frame, _)| frame).collect();
    let last = all.len().checked_sub(1)?;
    Some([0, last / 2, last].map(|i| all[i]))
}

/// The mask of one frame.
fn moving(model: &BackgroundModel, frames: &[&View], shown: &[Shown], frame: usize, options: &MaskOptions) -> Vec<u8> {
    let (width, height) = model.size;
    let view = frames[frame];
    let score = scores(model, frames, shown, frame);
    let vote = box_mean(&score, model.size);
    let mut mask: Vec<bool> = vote.iter().map(|vote| *vote >= SCORE_STRONG).collect();
    grow(&mut mask, model.size, |pixel| vote[pixel] >= SCORE_WEAK && score[pixel] >= SCORE_ALONE);
    // The middle that an object never uncovers joins its moving edges.
    let unsure = |pixel: usize| model.doubtful[pixel] || model.state[pixel] == State::Unstable;
    join(&mut mask, model.size, options.contact, |pixel| unsure(pixel) && score[pixel] < SCORE_ALONE);
    // Apparent shadow that moving pixels enclose joins them too.
    join(&mut mask, model.size, options.enclosed, |pixel| {
        counts(view, pixel) && differs(model, view, pixel) >= SCORE_ALONE
    });
    close_gaps(&mut mask, model.size);
    fill_holes(&mut mask, model.size, options.hole);
    let area_min = SPECK_MIN.max((options.speck * (width * height) as f64).round() as usize);
    drop_specks(&mut mask, model.size, area_min);
    mask.iter().enumerate().map(|(pixel, moves)| if *moves && counts(view, pixel) { 255 } else { 0 }).collect()
}

/// Squared distance of a pixel from its background over the variance of the noise, at most [`SCORE_MAX`].
fn differs(model: &BackgroundModel, view: &View, pixel: usize) -> f32 {
    let variance = model.deviation[pixel] * model.deviation[pixel];
    match model.state[pixel] {
        State::Masked => 0.0,
        State::Unstable => SCORE_MAX,
        State::Stable => (distance2(&color(view, pixel), &model.mean[pixel]) / variance).min(SCORE_MAX),
    }
}

/// Score of each pixel, 0 to [`SCORE_MAX`]; 0 where only the light differs.
fn scores(model: &BackgroundModel, frames: &[&View], shown: &[Shown], frame: usize) -> Vec<f32> {
    let view = frames[frame];
    let beside: Vec<&View> =
        [frame.checked_sub(1), Some(frame + 1)].into_iter().flatten().filter_map(|i| frames.get(i).copied()).collect();
    // Whether the frame before or after has the same colour up to noise and shadow.
    let rests = |pixel: usize| {
        let variance = model.deviation[pixel] * model.deviation[pixel];
        beside.iter().any(|other| {
            let same =
                distance2(&color(view, pixel), &color(other, pixel).map(f32::from)) <= 2.0 * SCORE_ALONE * variance;
            (counts(other, pixel) && same) || Light::new(model, view, other).is_shadow(pixel)
        })
    };
    // Compared with a single frame that shows the background: the model is put together from frames of different
    // light.
    let lit = |pixel: usize| {
        let beneath =
            || shown[pixel].into_iter().flatten().map(|other| Light::new(model, view, frames[other as usize]));
        beneath().any(|light| light.is_shadow(pixel)) || (beneath().any(|light| light.is_other(pixel)) && rests(pixel))
    };
    let score = |pixel: usize| {
        let score = if counts(view, pixel) { differs(model, view, pixel) } else { 0.0 };
        let quiet = || match model.state[pixel] {
            State::Stable => lit(pixel),
            // No colour returns often enough, but this one may stay for a while.
            State::Unstable => rests(pixel),
            State::Masked => true,
        };
        if score >= SCORE_ALONE && quiet() { 0.0 } else { score }
    };
    (0..model.mean.len()).map(score).collect()
}

/// The mean over 3 x 3 pixels, fewer at the image's edge.
fn box_mean(values: &[f32], (width, height): (usize, usize)) -> Vec<f32> {
    let mut across = vec![0.0; values.len()];
    for (row, out) in values.chunks_exact(width).zip(across.chunks_exact_mut(width)) {
        for x in 0..width {
            let span = &row[x.saturating_sub(1)..(x + 2).min(width)];
            out[x] = span.iter().sum::<f32>() / span.len() as f32;
        }
    }
    let mut mean = vec![0.0; values.len()];
    for y in 0..height {
        let rows = y.saturating_sub(1)..(y + 2).min(height);
        let scale = 1.0 / rows.len() as f32;
        for row in rows {
            let from = &across[row * width..(row + 1) * width];
            for (out, value) in mean[y * width..(y + 1) * width].iter_mut().zip(from) {
                *out += value * scale;
            }
        }
    }
    mean
}
