//! LiDAR points in images: colours of points, and depth images of a camera.

use glam::{DMat4, DVec2, DVec3};
use gs_datasets::{DatasetError, RgbImage8};
use rayon::prelude::*;

use crate::description::Camera;
use crate::log::DrivingLog;
use crate::sweep::Sweep;

/// Nearest camera depth at which a point is projected, metres: the bumper of the ego vehicle is farther from every
/// camera.
pub const NEAR: f64 = 0.5;

/// The pixel position and camera depth (metres) of a world point; `None` outside of the image or nearer than [`NEAR`].
/// Rows that show the ego vehicle are outside.
pub fn project(camera: &Camera, w2c: &DMat4, point: [f32; 3]) -> Option<(DVec2, f64)> {
    let local = w2c.transform_point3(DVec3::from_array(point.map(f64::from)));
    if local.z.is_nan() || local.z < NEAR {
        return None;
    }
    let pixel = camera.intrinsics.project(local);
    let rows = camera.height.saturating_sub(camera.ego_rows);
    let inside = pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x < camera.width as f64 && pixel.y < rows as f64;
    inside.then_some((pixel, local.z))
}

/// The colour of an image at a position, bilinear between the centres of pixels, 0 to 1 as the file encodes it.
/// Positions are inside.
pub fn sample(image: &RgbImage8, pixel: DVec2) -> [f32; 3] {
    let place = |position: f64, size: usize| {
        let p = (position - 0.5).clamp(0.0, size as f64 - 1.0);
        let first = (p as usize).min(size.saturating_sub(2));
        (first, (first + 1).min(size - 1), (p - first as f64) as f32)
    };
    let (x0, x1, u) = place(pixel.x, image.width);
    let (y0, y1, v) = place(pixel.y, image.height);
    let at = |x: usize, y: usize, channel: usize| f32::from(image.data[3 * (y * image.width + x) + channel]) / 255.0;
    std::array::from_fn(|c| {
        let row = |y: usize| at(x0, y, c) * (1.0 - u) + at(x1, y, c) * u;
        row(y0) * (1.0 - v) + row(y1) * v
    })
}

/// Colours of the points of a sweep from the images of its frame, `[points]`; `None` where no camera sees the point.
/// Where several do, the one in which the point is nearest to the middle counts. Occlusion is ignored, as in the paper,
/// and so is the motion between the time of a point and the time of the image.
///
/// # Errors
/// When an image is broken.
///
/// # Panics
/// When there is no such frame.
pub fn colors(log: &DrivingLog, frame: usize, sweep: &Sweep) -> Result<Vec<Option<[f32; 3]>>, DatasetError> {
    let cameras = 0..log.cameras().len();
    let images: Vec<(usize, RgbImage8)> = cameras
        .into_par_iter()
        .filter(|camera| log.view_index(frame, *camera).is_some())
        .map(|camera| Ok((camera, log.image(frame, camera)?)))
        .collect::<Result<_, DatasetError>>()?;
    let views: Vec<(&Camera, DMat4, &RgbImage8)> = images
        .iter()
        .filter_map(|(camera, image)| {
            let c2w = log.camera_pose(frame, *camera)?;
            Some((&log.cameras()[*camera], c2w.inverse(), image))
        })
        .collect();
    Ok(sweep.points.par_iter().map(|point| color(&views, *point)).collect())
}

fn color(views: &[(&Camera, DMat4, &RgbImage8)], point: [f32; 3]) -> Option<[f32; 3]> {
    let seen = views.iter().filter_map(|(camera, w2c, image)| {
        let (pixel, _) = project(camera, w2c, point)?;
        let off = (pixel.x / camera.width as f64 - 0.5).abs();
        Some((off, pixel, *image))
    });
    let best = seen.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(sample(best.2, best.1))
}

/// The depth image of a camera by the points of a sweep, `[height, width]`, camera z in metres; 0 where no point falls.
/// Of several points in a pixel the nearest counts.
pub fn depth_image(camera: &Camera, c2w: &DMat4, points: &[[f32; 3]]) -> Vec<f32> {
    let w2c = c2w.inverse();
    let mut depth = vec![0.0_f32; camera.width * camera.height];
    for (pixel, z) in points.iter().filter_map(|point| project(camera, &w2c, *point)) {
        let place = &mut depth[pixel.y as usize * camera.width + pixel.x as usize];
        if *place == 0.0 || (z as f32) < *place {
            *place = z as f32;
        }
    }
    depth
}
