//! What a configuration leaves to the data set, settled once it is loaded: the near plane and the background.

use gs_burn::RenderOptions;
use gs_datasets::{Scene, View};

use crate::data::Background;
use crate::data::suits::{NEAR_ADVISED, NEAR_MOST};
use crate::experiment::{Config, Pipeline};
use crate::scene_init::DEPTHS;

/// `render.near` in front of standing cameras without points, in median distances of the cameras from what they look at. Nothing that
/// such a rig films is nearer, no first point is looked for there, and what training grows nearer hangs before one camera like fog and
/// explains its photos alone. Twelve cameras all around, 800 steps, a held-out camera: 19.2 dB without, 17.9 at 0.2, 25.5 at 0.3,
/// 25.9 at 0.6.
const STANDING_NEAR: f64 = DEPTHS[0];

/// Share of the pixels along the borders of all photos that have one colour when it is the background's.
const BORDER: f64 = 0.5;

/// Levels of 255 within which colours are one.
const ONE_COLOR: u8 = 2;

/// `config` with a near plane and a background where it leaves them open.
pub fn settled(config: &Config, scene: &Scene) -> Config {
    let mut config = config.clone();
    if config.render.near == 0.0 {
        config.render.near = near(&config, scene);
    }
    if let Background::Found(_) = config.data.background {
        let found = border_color(&scene.train).unwrap_or([0; 3]);
        if found != [0; 3] {
            tracing::warn!(
                "most of the photos' borders are of one colour, {found:?} of 255, which is taken for the background's; \
                 data.background says otherwise"
            );
        }
        config.data.background = Background::Color(found.map(|level| f32::from(level) / 255.0));
    }
    config
}

fn near(config: &Config, scene: &Scene) -> f64 {
    let usual = RenderOptions::default().near;
    let has_points = scene.points.as_ref().is_some_and(|points| !points.is_empty());
    match scene.subject_distance() {
        Some(distance) if config.pipeline == Pipeline::Taylormode && !has_points => STANDING_NEAR * distance,
        Some(distance) if usual > NEAR_MOST * distance => NEAR_ADVISED * distance,
        _ => usual,
    }
}

/// The colour along the borders of most photos.
fn border_color(views: &[View]) -> Option<[u8; 3]> {
    let pixels: Vec<[u8; 3]> = views.iter().flat_map(border).collect();
    let middle = |channel: usize| {
        let mut levels: Vec<u8> = pixels.iter().map(|pixel| pixel[channel]).collect();
        levels.sort_unstable();
        levels.get(levels.len() / 2).copied()
    };
    let color = [middle(0)?, middle(1)?, middle(2)?];
    let is_near = |pixel: &&[u8; 3]| (0..3).all(|channel| pixel[channel].abs_diff(color[channel]) <= ONE_COLOR);
    let share = pixels.iter().filter(is_near).count() as f64 / pixels.len() as f64;
    (share > BORDER).then_some(color)
}

/// The outermost pixels of a photo.
fn border(view: &View) -> impl Iterator<Item = [u8; 3]> {
    let (width, height) = (view.width, view.height);
    let rows = (0..width).flat_map(move |x| [x, (height - 1) * width + x]);
    let columns = (0..height).flat_map(move |y| [y * width, y * width + width - 1]);
    rows.chain(columns).map(|pixel| [0, 1, 2].map(|channel| view.image.data[3 * pixel + channel]))
}

#[cfg(test)]
mod tests {
    use gs_datasets::{Intrinsics, PointCloud, RgbImage8, SceneFormat};

    use super::*;

    /// Twelve cameras on a ring of radius 4 that look at its middle; photos of one colour, the inner pixels of another.
    fn ring(color: u8) -> Scene {
        let view = |i: usize| {
            let turn = i as f64 * std::f64::consts::TAU / 12.0;
            let place = glam::DVec3::new(4.0 * turn.cos(), 0.0, 4.0 * turn.sin());
            let (z, y) = (-place.normalize(), glam::DVec3::Y);
            let column = |v: glam::DVec3, w: f64| v.extend(w);
            let c2w =
                glam::DMat4::from_cols(column(y.cross(z), 0.0), column(y, 0.0), column(z, 0.0), column(place, 1.0));
            let inner = |pixel: usize| (2..4).contains(&(pixel % 6)) && (2..4).contains(&(pixel / 6));
            let data = (0..36).flat_map(|pixel| [if inner(pixel) { 40 } else { color }; 3]).collect();
            View {
                name: i.to_string(),
                image_path: String::new().into(),
                c2w,
                intrinsics: Intrinsics { fx: 6.0, fy: 6.0, cx: 3.0, cy: 3.0 },
                width: 6,
                height: 6,
                time: Some(0.0),
                camera_id: None,
                image: RgbImage8 { width: 6, height: 6, data },
                mask: None,
                exposure: None,
                priors: Default::default(),
                truth: Default::default(),
            }
        };
        Scene {
            train: (0..12).map(view).collect(),
            test: Vec::new(),
            points: None,
            origin: glam::DVec3::ZERO,
            format: SceneFormat::Transforms,
            warnings: Vec::new(),
            time_range: None,
        }
    }

    fn config(overrides: &[&str]) -> Config {
        let overrides: Vec<String> = overrides.iter().map(|text| text.to_string()).collect();
        Config::resolve(None, &overrides).expect("valid")
    }

    #[test]
    fn what_is_left_open_is_found() {
        let moving = config(&["pipeline=taylormode"]);
        let found = settled(&moving, &ring(250));
        assert!((found.render.near - 1.2).abs() < 1e-9, "{}", found.render.near);
        assert_eq!(found.data.background, Background::Color([250.0 / 255.0; 3]));
        assert_eq!(settled(&found, &ring(7)), found, "settled once");
        let still = settled(&config(&[]), &ring(250));
        assert!((still.render.near - 0.01).abs() < 1e-9, "{}", still.render.near);

        let mut pointed = ring(0);
        pointed.points = Some(PointCloud { positions: vec![[0.0; 3]], colors: vec![[0; 3]] });
        let found = settled(&moving, &pointed);
        assert!((found.render.near - 0.01).abs() < 1e-9, "points say how near things are");
        assert_eq!(found.data.background, Background::Color([0.0; 3]));
    }

    #[test]
    fn what_is_chosen_stays() {
        let chosen = config(&["pipeline=taylormode", "render.near=0.5", "data.background=[0,1,0]"]);
        assert_eq!(settled(&chosen, &ring(250)), chosen);
    }

    #[test]
    fn borders_of_many_colours_are_no_background() {
        let mut scene = ring(250);
        for (i, view) in scene.train.iter_mut().enumerate() {
            view.image.data.iter_mut().for_each(|level| *level = level.saturating_sub(5 * i as u8));
        }
        assert_eq!(settled(&config(&[]), &scene).data.background, Background::Color([0.0; 3]));
    }
}
