//! Where in the image is the error? Sky, near and far surfaces, and what moves, by the street's truth.

use anyhow::{Context, Result};
use burn::tensor::{Tensor, TensorData};
use gs_driving::{TruthImage, truth_image};
use gs_pipelines::flux4d::evaluate::color;
use gs_pipelines::flux4d::moving::in_truth;
use gs_pipelines::flux4d::sample::{camera, photo};
use gs_train::run::metrics::psnr_masked;

use super::trial::{Seen, network, seen, street};
use crate::experiments::{Findings, Lab, Series};

/// Upper ends of the bins of distance, metres; the last has none, and the sky is a bin of its own.
const ENDS: [f32; 4] = [10.0, 20.0, 40.0, f32::INFINITY];

/// PSNR that surfaces beyond 40 m may lose against those of the nearest 10 m, dB. Twice the distance halves the points
/// a pixel has, and a bin is not to be lost for that.
const BOUND: f64 = 6.0;

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let Seen { log, host, inferred, .. } = seen(lab, &lab.street(&street())?, &network(lab)?)?;
    let device = &lab.device;
    let mut sums = [[0.0_f64; 2]; ENDS.len() + 1];
    for view in &host.targets {
        let (name, frame) = (&log.cameras()[view.camera].name, &log.frames()[view.frame].name);
        let known = truth_image(log.path(), name, frame)?.context("a synthetic street has its truth")?;
        let image = color(&inferred, &inferred.raw, &inferred.velocity, (&camera(&log, view, device), view.time));
        let (width, height) = (view.image.width, view.image.height);
        for (bin, sums) in sums.iter_mut().enumerate() {
            let mask: Vec<f32> =
                (0..width * height).map(|pixel| f32::from(bin_of(&known, pixel, [width, height]) == bin)).collect();
            let pixels = mask.iter().sum::<f32>();
            if pixels > 0.0 {
                let mask = Tensor::from_data(TensorData::new(mask, [height, width, 1]), device);
                let error = 10_f64.powf(-0.1 * psnr_masked(image.clone(), photo(view, device), mask));
                *sums = [sums[0] + error * f64::from(pixels), sums[1] + f64::from(pixels)];
            }
        }
    }
    let psnr = sums.map(|[error, pixels]| (pixels > 0.0).then(|| -10.0 * (error / pixels).log10()));
    let all: f64 = sums.iter().map(|[_, pixels]| pixels).sum();
    for (bin, psnr) in psnr.iter().enumerate() {
        let share = 100.0 * sums[bin][1] / all;
        let psnr = psnr.map_or("no pixel".to_string(), |psnr| format!("{psnr:.2} dB"));
        found.note(format!("{}: {psnr}, {share:.0} % of the pixels.", bin_name(bin)));
    }
    let lost = psnr[0].zip(psnr[ENDS.len() - 1]).map(|(near, far)| near - far);
    found.at_most("PSNR lost beyond 40 m against the nearest 10 m", lost, BOUND, "dB");
    let points = psnr.iter().enumerate().filter_map(|(bin, psnr)| psnr.map(|psnr| (bin as f64, psnr)));
    let series = [Series::line_and_dots("shipped network", points.collect())];
    let title = "Frames between the inputs by distance";
    found.chart("", title, ["to 10 m, 20 m, 40 m, beyond, sky", "PSNR, dB"], series);
    Ok(())
}

/// The bin of a pixel of an image of a width and height.
fn bin_of(truth: &TruthImage, pixel: usize, size: [usize; 2]) -> usize {
    match truth.depth[in_truth(truth, pixel, size)] {
        0.0 => ENDS.len(),
        depth => ENDS.iter().position(|end| depth <= *end).unwrap_or(ENDS.len() - 1),
    }
}

fn bin_name(bin: usize) -> String {
    match ENDS.get(bin) {
        None => "sky".into(),
        Some(end) if end.is_finite() => format!("to {end} m"),
        Some(_) => format!("beyond {} m", ENDS[bin - 1]),
    }
}
