//! How much motion per exposure can be deblurred?

use anyhow::Result;
use gs_base::median;
use gs_datasets::Scene;
use gs_worlds::deblur::{DeblurOptions, World};

use super::trial::trial;
use crate::experiments::lab::{moving_psnr, small};
use crate::experiments::{Findings, Lab, Series, smallest};

/// Differences below this are as likely from the order of sums as from the method, dB.
const NOISE: f64 = 0.1;

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    // Frames are far apart in time here, so that 60 pixels of blur need no extreme speed.
    let speeds: &[f64] = lab.either(&[0.0, 0.5, 1.0, 2.0, 4.0, 6.0], &[0.0, 1.0]);
    let (mut with, mut without) = (Vec::new(), Vec::new());
    for speed in speeds {
        let options = DeblurOptions { speed: *speed, subframes: 64, ..small(World::Cube, 5) };
        let scene = lab.world(&options)?;
        let pixels = pixels_of_motion(&scene, options.exposure_time());
        // Half as many instants as pixels, so that too few of them are not what is measured.
        let samples = format!("blur.samples={}", (pixels / 2.0).ceil().clamp(7.0, 21.0) as usize | 1);
        with.push((pixels, sharp(lab, &scene, &[&samples])?));
        without.push((pixels, sharp(lab, &scene, &["blur.mode=none"])?));
    }
    let gain = with.iter().zip(&without).map(|((pixels, with), (_, without))| (*pixels, with - without));
    let gain: Vec<(f64, f64)> = gain.collect();
    let moving = smallest(gain.iter().filter(|(pixels, _)| *pixels > 0.0).map(|(_, gain)| *gain));
    let static_gain = gain.iter().find(|(pixels, _)| *pixels == 0.0).map(|(_, gain)| *gain);
    let ladder =
        gain.iter().map(|(pixels, gain)| format!("{gain:+.1} dB at {pixels:.0}")).collect::<Vec<_>>().join(", ");
    found.at_least("gain over no blur model in moving parts at any speed, at worst", moving, -NOISE, "dB");
    found.at_least("gain where nothing moves", static_gain, -NOISE, "dB");
    let series = [Series::line_and_dots("integrate", with), Series::line_and_dots("no blur model", without)];
    let x = "pixels of motion per exposure (speed x exposure, mid-recording)";
    found.chart("", "Motion per exposure", [x, "sharp PSNR of moving parts, dB"], series);
    found.note(format!("Gain by pixels of motion: {ladder}."));
    found.note(
        "The object oscillates, so at the highest speeds it reverses within an exposure and a path of order 6 cannot \
         follow from frame to frame: there the bound says only that trying does no harm.",
    );
    Ok(())
}

fn sharp(lab: &Lab, scene: &Scene, changes: &[&str]) -> Result<f64> {
    Ok(moving_psnr(&trial(lab, scene, changes)?.measured(lab)?))
}

/// Median speed in the image at the middle of the recording, times the exposure, pixels.
fn pixels_of_motion(scene: &Scene, exposure: f64) -> f64 {
    let mut pixels = Vec::new();
    for view in scene.train.iter().filter(|view| view.time == Some(0.5)) {
        let truth = &view.truth;
        let (Some(moving), Some(depth), Some(velocity)) = (&truth.moving, &truth.depth, &truth.velocity) else {
            continue;
        };
        let inverse = view.c2w.inverse();
        for pixel in (0..moving.len()).filter(|pixel| moving[*pixel] > 0) {
            let v = inverse.transform_vector3(glam::Vec3::from_slice(&velocity[3 * pixel..]).as_dvec3());
            // Motion along the line of sight moves only pixels away from the image's centre; ignored.
            pixels.push(v.truncate().length() * view.intrinsics.fx / f64::from(depth[pixel]) * exposure);
        }
    }
    median(pixels).unwrap_or(f64::NAN)
}
