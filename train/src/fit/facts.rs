//! Facts: values that a data set fixes for training and measuring, namely the scene's extent, the near plane and the
//! background.
//!
//! A configuration may leave them open (`render.near = 0`, `data.background = "auto"`). The values found are kept here;
//! the configuration is never changed.

use gs_burn::RenderOptions;
use gs_datasets::{Scene, View, surveyed};
use serde::{Deserialize, Serialize};

use super::initialise::size_of;
use super::preflight::{NEAR_ADVISED, NEAR_MOST};
use super::region::Region;
use crate::config::{Background, Config, RenderConfig};

/// Least share of equal pixels along the borders of all photos at which their colour is taken for the background's.
const BORDER: f64 = 0.5;

/// Largest difference of equal colours, levels of 255.
const ONE_COLOR: u8 = 2;

/// The background where the photos' borders have no common colour: what no training camera sees has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unseen {
    /// Black, as published.
    Black,
    /// The photos' mean colour, the best constant guess.
    MeanColor,
}

/// Values fixed by the data set.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SceneFacts {
    /// The scene's extent, scene units: rates and thresholds are relative to it.
    pub extent: f64,
    /// Near plane: Gaussians nearer than this are culled, scene units.
    pub near: f64,
    /// Colour behind the scene, 0 to 1 per channel.
    pub background: [f32; 3],
    /// Median distance of the training cameras from the subject, scene units; `None` if their axes do not meet.
    pub subject_distance: Option<f64>,
    /// Size of a photo's pixel at that distance, scene units, by the median focal length; `None` without one.
    #[serde(default)]
    pub pixel: Option<f64>,
    /// The region of interest.
    #[serde(default)]
    pub region: Option<Region>,
}

impl SceneFacts {
    /// The facts of `scene`; values given by `config` take precedence. `near_share` is the method's near plane for a
    /// configuration that leaves it open, as a share of the subject's distance; `None`: the renderer's own. `unseen` is
    /// its background where the photos do not tell.
    pub fn of(scene: &Scene, config: &Config, near_share: Option<f64>, unseen: Unseen) -> Self {
        let subject_distance = scene.subject_distance();
        let views = surveyed(&scene.train);
        let is_transparent = views.iter().any(|view| view.alpha.is_some());
        Self {
            extent: size_of(scene),
            near: if config.render.near > 0.0 { config.render.near } else { near(subject_distance, near_share) },
            background: match config.data.background {
                Background::Found(_) if !is_transparent => found_background(views, unseen),
                // What is transparent was composited on it.
                loaded => loaded.color(),
            },
            subject_distance,
            pixel: subject_distance.and_then(|distance| Some(distance / focal(&scene.train)?)),
            region: Region::of(&config.data.region, scene.origin),
        }
    }

    /// Facts of an unknown scene, from the configuration alone.
    pub fn unknown(config: &Config) -> Self {
        let near = if config.render.near > 0.0 { config.render.near } else { RenderOptions::default().near };
        let background = config.data.background.color();
        Self { extent: 1.0, near, background, subject_distance: None, pixel: None, region: None }
    }

    /// The unit of cameras' translations, scene units: the subject's distance, or the extent where none is known.
    pub fn distance(&self) -> f64 {
        self.subject_distance.unwrap_or(self.extent)
    }

    /// The options of a rendering at an SH degree.
    pub fn render_options(&self, config: &RenderConfig, sh_degree: usize) -> RenderOptions {
        RenderOptions {
            sh_degree,
            background: self.background,
            near: self.near,
            far: config.far,
            eps2d: config.eps2d,
            antialiased: config.antialiased,
            ..RenderOptions::default()
        }
    }

    /// Name, value and key of each fact, for people.
    pub fn listed(&self) -> Vec<(&'static str, String, &'static str)> {
        let [red, green, blue] = self.background;
        let distance = self.subject_distance.map_or("the cameras' axes do not meet".into(), |d| format!("{d:.4}"));
        vec![
            ("extent, scene units", format!("{:.4}", self.extent), ""),
            ("distance of the subject, scene units", distance, ""),
            ("near plane, scene units", format!("{:.4}", self.near), "render.near"),
            ("background", format!("{red:.3}, {green:.3}, {blue:.3}"), "data.background"),
        ]
    }
}

/// The median focal length of photos, pixels; `None` without a photo.
pub(super) fn focal(views: &[View]) -> Option<f64> {
    gs_base::median(views.iter().map(|view| view.intrinsics.fx).collect())
}

fn near(distance: Option<f64>, share: Option<f64>) -> f64 {
    let usual = RenderOptions::default().near;
    match (distance, share) {
        (Some(distance), Some(share)) => share * distance,
        (Some(distance), None) if usual > NEAR_MOST * distance => NEAR_ADVISED * distance,
        _ => usual,
    }
}

/// The colour along the photos' borders, if most are of one; else that of `unseen`.
fn found_background(views: &[View], unseen: Unseen) -> [f32; 3] {
    let Some(found) = border_color(views) else {
        return match unseen {
            Unseen::Black => [0.0; 3],
            Unseen::MeanColor => mean_color(views),
        };
    };
    if found != [0; 3] {
        tracing::warn!(
            "most of the photos' borders are of one colour, {found:?} of 255, which is taken for the background's; \
             data.background says otherwise"
        );
    }
    found.map(|level| f32::from(level) / 255.0)
}

/// The mean over all pixels of all photos that count, 0 to 1; black without any.
fn mean_color(views: &[View]) -> [f32; 3] {
    let (mut sums, mut count) = ([0u64; 3], 0u64);
    for view in views {
        let pixels = view.image.data.as_chunks::<3>().0;
        for (_, color) in pixels.iter().enumerate().filter(|(pixel, _)| counts(view, *pixel)) {
            (0..3).for_each(|channel| sums[channel] += u64::from(color[channel]));
            count += 1;
        }
    }
    sums.map(|sum| (sum as f64 / (255 * count.max(1)) as f64) as f32)
}

/// Whether no mask ignores a pixel. Pixels that a lens never reaches are black, whatever is behind the scene.
fn counts(view: &View, pixel: usize) -> bool {
    view.mask.as_ref().is_none_or(|mask| mask[pixel] != 0)
}

/// The colour along the borders of most photos, if there is one.
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

/// The outermost pixels of a view that count.
fn border(view: &View) -> impl Iterator<Item = [u8; 3]> {
    let (width, height) = (view.width, view.height);
    let rows = (0..width).flat_map(move |x| [x, (height - 1) * width + x]);
    let columns = (0..height).flat_map(move |y| [y * width, y * width + width - 1]);
    let pixels = rows.chain(columns).filter(|pixel| counts(view, *pixel));
    pixels.map(|pixel| [0, 1, 2].map(|channel| view.image.data[3 * pixel + channel]))
}

#[cfg(test)]
mod tests {
    use gs_datasets::SceneFormat;

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
            let mut view = View { name: i.to_string(), c2w, time: Some(0.0), ..View::blank(6, 6) };
            view.image.data = (0..36).flat_map(|pixel| [if inner(pixel) { 40 } else { color }; 3]).collect();
            view
        };
        Scene {
            train: (0..12).map(view).collect(),
            held_out: Vec::new(),
            points: None,
            origin: glam::DVec3::ZERO,
            format: SceneFormat::Transforms,
            poses: gs_datasets::PoseConvention::of(SceneFormat::Transforms),
            warnings: Vec::new(),
            time_range: None,
        }
    }

    #[test]
    fn what_is_left_open_is_found() {
        let config = Config::default();
        let found = SceneFacts::of(&ring(250), &config, Some(0.3), Unseen::MeanColor);
        assert!((found.near - 1.2).abs() < 1e-9, "{}", found.near);
        assert!((found.subject_distance.expect("the axes meet") - 4.0).abs() < 1e-9);
        let focal = ring(250).train[0].intrinsics.fx;
        assert!((found.pixel.expect("the axes meet") - 4.0 / focal).abs() < 1e-9);
        assert_eq!(found.background, [250.0 / 255.0; 3]);
        let plain = SceneFacts::of(&ring(0), &config, None, Unseen::MeanColor);
        assert!((plain.near - 0.01).abs() < 1e-9, "{}", plain.near);
        assert_eq!(plain.background, [0.0; 3]);
    }

    #[test]
    fn what_is_chosen_stays() {
        let mut config = Config::default();
        config.render.near = 0.5;
        config.data.background = Background::Color([0.0, 1.0, 0.0]);
        let found = SceneFacts::of(&ring(250), &config, Some(0.3), Unseen::MeanColor);
        assert_eq!((found.near, found.background), (0.5, [0.0, 1.0, 0.0]));
    }

    /// A camera that stands nearer to its subject than the usual near plane still sees it.
    #[test]
    fn a_small_world_has_a_near_plane_of_its_own() {
        let mut scene = ring(250);
        scene.train.iter_mut().for_each(|view| view.c2w.w_axis = (view.c2w.w_axis.truncate() * 1e-3).extend(1.0));
        let found = SceneFacts::of(&scene, &Config::default(), None, Unseen::MeanColor);
        assert!((found.near - 4e-3 * NEAR_ADVISED).abs() < 1e-12, "{}", found.near);
    }

    #[test]
    fn borders_of_many_colours_are_no_background() {
        let mut scene = ring(250);
        for (i, view) in scene.train.iter_mut().enumerate() {
            view.image.data.iter_mut().for_each(|level| *level = level.saturating_sub(5 * i as u8));
        }
        let levels = scene.train.iter().flat_map(|view| &view.image.data).map(|level| f64::from(*level));
        let mean = (levels.sum::<f64>() / (12.0 * 36.0 * 3.0 * 255.0)) as f32;
        let found = SceneFacts::of(&scene, &Config::default(), None, Unseen::MeanColor).background;
        assert!(found.iter().all(|channel| (channel - mean).abs() < 1e-6), "{found:?}, not {mean}");
        assert_eq!(SceneFacts::of(&scene, &Config::default(), None, Unseen::Black).background, [0.0; 3]);
    }

    /// Black where an undistorted photo has no colour is no background.
    #[test]
    fn borders_that_a_mask_ignores_are_no_background() {
        let mut scene = ring(0);
        let inner = |pixel: usize| (1..5).contains(&(pixel % 6)) && (1..5).contains(&(pixel / 6));
        let mask: Vec<u8> = (0..36).map(|pixel| if inner(pixel) { 255 } else { 0 }).collect();
        scene.train.iter_mut().for_each(|view| view.mask = Some(mask.clone()));
        let found = SceneFacts::of(&scene, &Config::default(), None, Unseen::MeanColor).background;
        // Four of the sixteen pixels that count have level 40, the others are black.
        assert!((found[0] - 10.0 / 255.0).abs() < 1e-6, "{found:?}");
    }
}
