//! Which pixels of a standing camera move: those that differ from its background by more than noise and shadow.

use rayon::prelude::*;

use crate::frame::View;

use super::background::{Plate, SAMPLES_MIN, State, color, counts};
use super::cameras::StaticCamera;
use super::cluster::distance2;
use super::regions::{close_gaps, drop_specks, fill_holes, grow, join};
use super::shadow::Shadows;

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
/// that is rare in the background. A surface that darkens without texture of its own passes for a shadow.
pub fn evidence(views: &[View], camera: &StaticCamera) -> Option<Evidence> {
    let plate = Plate::new(views, camera)?;
    let masks = camera.views.par_iter().map(|index| moving(&plate, &views[*index])).collect();
    Some(Evidence { masks, noise: plate.noise })
}

fn moving(plate: &Plate, view: &View) -> Vec<u8> {
    let (width, height) = plate.size;
    let voice = voices(plate, view);
    let vote = box_mean(&voice, plate.size);
    let mut mask: Vec<bool> = vote.iter().map(|vote| *vote >= STRONG).collect();
    grow(&mut mask, plate.size, |pixel| vote[pixel] >= WEAK && voice[pixel] >= OWN);
    // What an object of one colour never uncovers joins its moving edges.
    join(&mut mask, plate.size, CONTACT, |pixel| plate.doubtful[pixel] && voice[pixel] < OWN);
    close_gaps(&mut mask, plate.size);
    fill_holes(&mut mask, plate.size, HOLE);
    let area_min = SPECK.1.max((SPECK.0 * (width * height) as f64).round() as usize);
    drop_specks(&mut mask, plate.size, area_min);
    mask.iter().enumerate().map(|(pixel, moves)| if *moves && counts(view, pixel) { 255 } else { 0 }).collect()
}

/// What each pixel says, 0 to [`VOICE`].
fn voices(plate: &Plate, view: &View) -> Vec<f32> {
    let (width, height) = plate.size;
    let shadows = Shadows::new(plate, &view.image.data);
    let voice = |pixel: usize| match plate.state[pixel] {
        _ if !counts(view, pixel) => 0.0,
        State::Unseen => 0.0,
        State::Restless => VOICE,
        State::Known => {
            let variance = plate.deviation[pixel] * plate.deviation[pixel];
            let voice = (distance2(&color(view, pixel), &plate.mean[pixel]) / variance).min(VOICE);
            let (x, y) = (pixel % width, pixel / width);
            let inner = x > 0 && y > 0 && x + 1 < width && y + 1 < height;
            if voice >= OWN && inner && shadows.contains(pixel) { 0.0 } else { voice }
        }
    };
    (0..width * height).map(voice).collect()
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
