//! The pixels of an image that move, by the truth of a synthetic log or by labelled LiDAR points.

use anyhow::Result;
use gs_driving::{DrivingLog, MOVING_FLOW, TruthImage, truth_image};

use super::host_view::{HostView, Posed};
use super::prepare::HostSnippet;

/// Slowest motion that counts, metres in 0.1 s: the limit between static and dynamic of the flow labels.
pub const MOVING: f32 = MOVING_FLOW as f32;
/// Pixels around a moving LiDAR point that count as moving: about the distance between neighbouring points of a car
/// at 20 m.
const AROUND: usize = 2;

/// `[height, width]`: 255 where the image of a view moves; `None` where nothing does or nothing is known.
///
/// # Errors
/// When a file of the truth or the sweep is broken.
pub fn mask(log: &DrivingLog, host: &HostSnippet, view: &HostView) -> Result<Option<Vec<u8>>> {
    let (camera, frame) = (&log.cameras()[view.camera].name, &log.frames()[view.frame].name);
    let mask = match truth_image(log.path(), camera, frame)? {
        Some(truth) => of_truth(&truth, view),
        None => of_points(log, host, view)?,
    };
    Ok(mask.contains(&255).then_some(mask))
}

fn of_truth(truth: &TruthImage, view: &HostView) -> Vec<u8> {
    let (width, height) = (view.image.width, view.image.height);
    let moves = |pixel: usize| {
        let place = in_truth(truth, pixel, [width, height]);
        let squared: f32 = truth.flow.iter().map(|axis| axis[place] * axis[place]).sum();
        squared >= MOVING * MOVING
    };
    (0..width * height).map(|pixel| if moves(pixel) { 255 } else { 0 }).collect()
}

/// The pixel of the truth at a pixel of an image of `width` and `height`, which may have been downscaled.
pub fn in_truth(truth: &TruthImage, pixel: usize, [width, height]: [usize; 2]) -> usize {
    let (x, y) = (pixel % width * truth.width / width, pixel / width * truth.height / height);
    y.min(truth.height - 1) * truth.width + x
}

fn of_points(log: &DrivingLog, host: &HostSnippet, view: &HostView) -> Result<Vec<u8>> {
    let (width, height) = (view.image.width, view.image.height);
    let mut mask = vec![0; width * height];
    let sweep = host.labelled_sweep(log, view.frame)?;
    let Some(labels) = &sweep.labels else { return Ok(mask) };
    let posed = Posed::new(log, view);
    for (point, flow) in sweep.points.iter().zip(&labels.flow) {
        let moves = flow.is_some_and(|flow| flow.iter().map(|x| x * x).sum::<f32>() >= MOVING * MOVING);
        let Some((pixel, _)) = posed.place(*point).filter(|_| moves) else { continue };
        let (x, y) = (pixel.x as usize, pixel.y as usize);
        for row in y.saturating_sub(AROUND)..(y + AROUND + 1).min(height) {
            let columns = x.saturating_sub(AROUND)..(x + AROUND + 1).min(width);
            mask[row * width..][columns].fill(255);
        }
    }
    Ok(mask)
}
