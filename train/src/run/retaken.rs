//! Training photos formed again by the cameras' learned paths.

use burn::tensor::{Device, Tensor, TensorData};
use gs_burn::{Rendering, render};
use gs_datasets::View;
use gs_models::camera_path::Path;
use gs_models::light::Mixing;

use super::evaluate::Comparison;
use super::metrics::psnr_counted;
use crate::fit::method::Step;
use crate::fit::parameters::to_host;
use crate::fit::photos::Photos;
use crate::fit::shutter::formed;
use crate::fit::told::Told;
use crate::fit::trainer::Model;

/// Most photos, spread evenly over all.
const SHOWN: usize = 4;

/// Fewest instants where objects move.
const MOVING: usize = 7;

/// Places across and down at which a path is drawn.
const PLACES: usize = 3;

/// Dots of a drawn path: closer than a pixel on one of 60.
const DOTS: usize = 64;

/// The colour of a drawn path.
const COLOR: [f32; 3] = [1.0, 0.9, 0.0];

/// Some training photos beside the blurry images that the scene forms along their cameras' paths, in the median of the
/// exposures, the sharp views from their middles, and the paths drawn over them; none where no camera moves.
pub fn retaken<M: Told>(model: &Model<M>, train: &[View], at: &Step<M>, device: &Device) -> Vec<Comparison> {
    let Some(cameras) = model.cameras.as_ref().filter(|_| at.config.camera.motion > 0) else { return Vec::new() };
    let scene = model.method.scene(model.gaussians.clone());
    let options = at.facts.render_options(&at.config.render, model.gaussians.sh_degree());
    let half = 0.5 * scene.exposure().unwrap_or(0.0);
    let least = if half > 0.0 { MOVING } else { 1 };
    let paths = cameras.listed();
    let mut photos = Photos::plain(train, device);
    let mut one = |index: usize| {
        let (view, shown) = (&train[index], [photos.get(index)]);
        let photo = &model.taken(&shown, train, at.facts)[0];
        let instants = photo.instants(least);
        let times: Vec<f64> = instants.iter().map(|it| photo.time + it.at * half * photo.frame()).collect();
        let scenes = scene.at_times(&times);
        let rendered = scenes.iter().zip(&instants).map(|(scene, it)| render(scene, &it.camera, &it.options(&options)));
        let renderings: Vec<Rendering> = rendered.collect();
        let sharp = render(&scene.at(photo.time), &photo.middle(), &options).color;
        let [image, sharp] =
            [formed(&instants, &renderings, Mixing::Linear), sharp].map(|seen| photo.taken(seen).clamp(0.0, 1.0));
        let path = paths.iter().find(|(name, _)| *name == view.name)?;
        Some(Comparison {
            // A held-out photo of another folder may have the same name.
            name: format!("{}-formed", view.name),
            psnr: psnr_counted(image.clone(), photo.image.clone(), photo.mask.clone()),
            more: vec![
                ("sharp view", sharp),
                ("path over the photo", drawn(photo.image.clone(), &path.1, (view, cameras.focal()))),
            ],
            truth: photo.image.clone(),
            image,
            mask: photo.mask.clone(),
            blurry: None,
        })
    };
    (0..train.len()).step_by(train.len().div_ceil(SHOWN).max(1)).filter_map(&mut one).collect()
}

/// `image` with the path, in pixels at the focal length `focal`, of places at the subject's distance drawn over it.
fn drawn(image: Tensor<3>, path: &Path, (view, focal): (&View, f64)) -> Tensor<3> {
    let (mut values, [height, width, _]) = (to_host(image.clone()), image.dims());
    let middle = |k: usize| (2 * k + 1) as f64 / (2 * PLACES) as f64;
    let dots = (0..PLACES * PLACES).flat_map(|place| {
        let [x, y] = [middle(place % PLACES) * width as f64, middle(place / PLACES) * height as f64];
        let direction = [(x - view.intrinsics.cx) / view.intrinsics.fx, (y - view.intrinsics.cy) / view.intrinsics.fy];
        (0..=DOTS).map(move |k| {
            let [right, down] = path.at(2.0 * k as f64 / DOTS as f64 - 1.0, direction);
            let [across, along] = [view.intrinsics.fx, view.intrinsics.fy].map(|own| own / focal);
            [x + right * across, y + down * along]
        })
    });
    for [x, y] in dots.filter(|[x, y]| (0.0..width as f64).contains(x) && (0.0..height as f64).contains(y)) {
        values[3 * (y as usize * width + x as usize)..][..3].copy_from_slice(&COLOR);
    }
    Tensor::from_data(TensorData::new(values, image.dims()), &image.device())
}
