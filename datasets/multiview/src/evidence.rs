//! Which pixels of a standing camera move: those that differ from its background by more than noise and shadow.

use rayon::prelude::*;

use gs_datasets::View;

use crate::background::{Plate, SAMPLES_MIN, State};
use crate::cameras::StaticCamera;
use crate::cluster::{MEMBER, distance2};
use crate::pixels::{color, counts};
use crate::regions::{close_gaps, drop_specks, fill_holes, grow, join};
use crate::shadow::Light;

/// Fewest views of a standing camera from which masks are made.
pub const FRAMES_MIN: usize = SAMPLES_MIN;

/// Most that one pixel says: its squared difference over the noise's variance is cut here (five standard deviations),
/// so that a mean over neighbours is a vote and one broken pixel is none.
const VOICE: f32 = 25.0;

/// A pixel moves when the mean voice of its 3 x 3 neighbours reaches this. Noise gives 3 with a standard deviation of
/// 0.8, so chance does not; at a straight edge against still pixels half of the neighbours are needed, so masks
/// keep their size. In levels: a change of twice the noise in every channel is seen.
const STRONG: f32 = 12.0;

/// A pixel beside a moving one moves when it reaches this (five standard deviations) and itself [`OWN`].
const WEAK: f32 = 7.0;

/// Own voice that a weak pixel needs: three standard deviations, or the mask would grow by a pixel all around.
const OWN: f32 = 9.0;

/// Smallest region that is kept, as a share of the image and in pixels. A 10 x 10 ball in 640 x 360 has 80.
const SPECK: (f64, usize) = (1e-4, 8);

/// Holes up to this share of the region around them are filled: an object's inside may have the background's colour or
/// none that changes. Larger ones may be those of a ring.
const HOLE: f64 = 0.25;

/// Share of its outline that a region in an object's colour must have in common with what moves in order to join it.
/// The middle that an object never uncovers lies within its moving edges, apart from where it lies on the outline
/// itself; static things of the same colour touch it here and there.
const CONTACT: f64 = 0.4;

/// The same for what passes for a shadow: a shirt of the wall's colour lies between head, arms and trousers, a shadow on the
/// floor touches its object on one side.
const ENCLOSED: f64 = 0.5;

/// What the photos of a standing camera say.
#[derive(Debug, Clone, PartialEq)]
pub struct Evidence {
    /// For each of the camera's views, in its order: `[height, width]`, 255 where something moves.
    pub masks: Vec<Vec<u8>>,
    /// Standard deviation of the sensor's noise as it was found, levels of 255.
    pub noise: f32,
}

/// Masks of what moves in a standing camera's views. `None` when the camera has fewer than [`FRAMES_MIN`] views, so for
/// cameras that move.
///
/// Limits: in blurry photos the mask covers what the object touched during the exposure, down to where its share of the
/// exposure drops into the noise. What an object never uncovers is found only by its texture, or by its colour where
/// that is rare in the background. A surface that darkens without texture of its own passes for a shadow where it is not
/// surrounded by what moves.
pub fn evidence(views: &[View], camera: &StaticCamera) -> Option<Evidence> {
    let plate = Plate::new(views, camera)?;
    let frames: Vec<&View> = camera.views.iter().map(|index| &views[*index]).collect();
    let shown: Vec<Shown> = (0..plate.mean.len()).into_par_iter().map(|pixel| shown(&plate, &frames, pixel)).collect();
    let masks = (0..frames.len()).into_par_iter().map(|frame| moving(&plate, &frames, &shown, frame)).collect();
    Some(Evidence { masks, noise: plate.noise })
}

/// The first, the middle and the last frame that show the background's colour at a pixel, by their number in time; `None` where none
/// does.
type Shown = Option<[u32; 3]>;

fn shown(plate: &Plate, frames: &[&View], pixel: usize) -> Shown {
    let (mean, variance) = (&plate.mean[pixel], plate.deviation[pixel] * plate.deviation[pixel]);
    let shows = |view: &View| counts(view, pixel) && distance2(&color(view, pixel), mean) <= MEMBER * variance;
    let all: Vec<u32> = (0..).zip(frames).filter(|(_, view)| shows(view)).map(|(frame, _)| frame).collect();
    let last = all.len().checked_sub(1)?;
    Some([0, last / 2, last].map(|i| all[i]))
}

/// The mask of one frame.
fn moving(plate: &Plate, frames: &[&View], shown: &[Shown], frame: usize) -> Vec<u8> {
    let (width, height) = plate.size;
    let view = frames[frame];
    let voice = voices(plate, frames, shown, frame);
    let vote = box_mean(&voice, plate.size);
    let mut mask: Vec<bool> = vote.iter().map(|vote| *vote >= STRONG).collect();
    grow(&mut mask, plate.size, |pixel| vote[pixel] >= WEAK && voice[pixel] >= OWN);
    // What an object never uncovers joins its moving edges.
    let unsure = |pixel: usize| plate.doubtful[pixel] || plate.state[pixel] == State::Restless;
    join(&mut mask, plate.size, CONTACT, |pixel| unsure(pixel) && voice[pixel] < OWN);
    // So does what passes for a shadow and is enclosed by it.
    join(&mut mask, plate.size, ENCLOSED, |pixel| counts(view, pixel) && differs(plate, view, pixel) >= OWN);
    close_gaps(&mut mask, plate.size);
    fill_holes(&mut mask, plate.size, HOLE);
    let area_min = SPECK.1.max((SPECK.0 * (width * height) as f64).round() as usize);
    drop_specks(&mut mask, plate.size, area_min);
    mask.iter().enumerate().map(|(pixel, moves)| if *moves && counts(view, pixel) { 255 } else { 0 }).collect()
}

/// How far a pixel is from its background: squared, over the noise's variance, at most [`VOICE`].
fn differs(plate: &Plate, view: &View, pixel: usize) -> f32 {
    let variance = plate.deviation[pixel] * plate.deviation[pixel];
    match plate.state[pixel] {
        State::Unseen => 0.0,
        State::Restless => VOICE,
        State::Known => (distance2(&color(view, pixel), &plate.mean[pixel]) / variance).min(VOICE),
    }
}

/// What each pixel says, 0 to [`VOICE`]: how far it is from its background, unless only the light differs.
fn voices(plate: &Plate, frames: &[&View], shown: &[Shown], frame: usize) -> Vec<f32> {
    let view = frames[frame];
    let beside: Vec<&View> =
        [frame.checked_sub(1), Some(frame + 1)].into_iter().flatten().filter_map(|i| frames.get(i).copied()).collect();
    // In the frame before or after: the same but for noise and shadow.
    let rests = |pixel: usize| {
        let variance = plate.deviation[pixel] * plate.deviation[pixel];
        beside.iter().any(|other| {
            let same = distance2(&color(view, pixel), &color(other, pixel).map(f32::from)) <= 2.0 * OWN * variance;
            (counts(other, pixel) && same) || Light::new(plate, view, other).is_shadow(pixel)
        })
    };
    // A frame that shows the background, and not the background: that is put together from frames of different light.
    let lit = |pixel: usize| {
        let beneath =
            || shown[pixel].into_iter().flatten().map(|other| Light::new(plate, view, frames[other as usize]));
        beneath().any(|light| light.is_shadow(pixel)) || (beneath().any(|light| light.is_other(pixel)) && rests(pixel))
    };
    let voice = |pixel: usize| {
        let voice = if counts(view, pixel) { differs(plate, view, pixel) } else { 0.0 };
        let quiet = || match plate.state[pixel] {
            State::Known => lit(pixel),
            // No colour stays for long enough, but this one may for a while.
            State::Restless => rests(pixel),
            State::Unseen => true,
        };
        if voice >= OWN && quiet() { 0.0 } else { voice }
    };
    (0..plate.mean.len()).map(voice).collect()
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
