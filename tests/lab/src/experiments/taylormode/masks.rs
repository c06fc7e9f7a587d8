//! The cost of masks that are too wide or too narrow. Segmentation of blurry outlines is uncertain.

use anyhow::Result;
use gs_datasets::Scene;
use gs_worlds::deblur::World;

use super::trial::trial;
use crate::experiments::lab::{moving_psnr, small};
use crate::experiments::{Findings, Lab, Series, largest};

/// Largest mask error for which bounds hold, pixels. The object is about 20 pixels wide; a segmentation that misses its
/// outline by more than a tenth of that on either side is a poor one.
const PROMISED: i32 = 2;

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let scene = lab.world(&small(World::Cube, 6))?;
    let widths: &[i32] = lab.either(&[-6, -4, -2, 0, 2, 4, 6], &[-2, 0, 2]);
    let (mut moving, mut whole) = (Vec::new(), Vec::new());
    for pixels in widths {
        let found = trial(lab, &grown(&scene, *pixels), &["motion.masks=prior"])?.measured(lab)?;
        moving.push((f64::from(*pixels), moving_psnr(&found)));
        whole.push((f64::from(*pixels), found.quality.mean.psnr));
    }
    let loss = |points: &[(f64, f64)], reach: i32| {
        let exact = points.iter().find(|(width, _)| *width == 0.0).map_or(f64::NAN, |(_, psnr)| *psnr);
        let near = points.iter().filter(|(width, _)| width.abs() <= f64::from(reach));
        largest(near.map(|(_, psnr)| exact - psnr))
    };
    let range = *widths.last().unwrap_or(&0);
    let what = "loss in moving parts, masks wrong by up to 2 pixels";
    found.at_most(what, loss(&moving, PROMISED), 1.0, "dB");
    let what = "loss over the whole image, masks wrong by up to 2 pixels";
    found.at_most(what, loss(&whole, PROMISED), 0.5, "dB");
    let worst = loss(&moving, range).unwrap_or(f64::NAN);
    found.note(format!("Up to {range} pixels wrong, moving parts lose {worst:.2} dB at most."));
    found.note("The bounds were set before measuring, for errors of a usual segmentation.");
    let series = [Series::line_and_dots("moving parts", moving), Series::line_and_dots("whole image", whole)];
    found.chart("", "Masks too narrow and too wide", ["pixels that masks are wider", "sharp PSNR, dB"], series);
    Ok(())
}

/// The scene with its true masks as priors, dilated by `pixels`, or eroded if negative.
fn grown(scene: &Scene, pixels: i32) -> Scene {
    let mut scene = scene.clone();
    for view in &mut scene.train {
        view.priors.moving = view.truth.moving.clone().map(|mut mask| {
            for round in 0..pixels.unsigned_abs() {
                mask = step(&mask, view.width, pixels > 0, round % 2 == 1);
            }
            mask
        });
    }
    scene
}

/// Dilation or erosion by one pixel, over four neighbours or eight; in alternation, circles stay round.
fn step(mask: &[u8], width: usize, wider: bool, corners: bool) -> Vec<u8> {
    let height = mask.len() / width;
    let spreading = u8::from(wider) * 255;
    let value_at = |x: usize, y: usize, dx: isize, dy: isize| {
        let (x, y) = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
        (x < width && y < height).then(|| mask[y * width + x])
    };
    let reached = |x: usize, y: usize| {
        let neighbours = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
        let mut near = neighbours.filter(|(dx, dy)| corners || *dx == 0 || *dy == 0);
        near.any(|(dx, dy)| value_at(x, y, dx, dy) == Some(spreading))
    };
    (0..mask.len()).map(|i| if reached(i % width, i / width) { spreading } else { mask[i] }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_grow_and_shrink() {
        let mut mask = vec![0; 81];
        mask[40] = 255;
        let count = |mask: &[u8]| mask.iter().filter(|value| **value > 0).count();
        let cross = step(&mask, 9, true, false);
        let square = step(&cross, 9, true, true);
        assert_eq!([count(&cross), count(&square)], [5, 21]);
        assert_eq!(count(&step(&cross, 9, false, false)), 1);
        assert_eq!(count(&step(&cross, 9, false, true)), 0);
    }
}
