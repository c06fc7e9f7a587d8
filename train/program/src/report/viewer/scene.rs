//! A scene as a page holds it: JSON with cameras and options, and the block with its numbers.

use glam::{DMat4, DVec3};
use gs_base::{agree, counted};
use gs_burn::Gaussians;
use gs_models::{DynamicScene, Shutter};
use serde::Serialize;

use super::block::{Array, Block};
use super::motion::{Clock, Motion, normalise};
use gs_splats::Splats;
use gs_train::fit::parameters::to_host;
use gs_train::run::exchange::host::splats_of;
use gs_train::run::presentation::{Camera, Presentation};

/// Up to so many Gaussians a page has everything; beyond, colour is the same from all sides (SH 0).
pub const WITH_SH_MAX: usize = 300_000;

/// Up to so many Gaussians a page has all of them; beyond, the least visible are left out. A page of a million takes
/// some 25 MB.
pub const GAUSSIANS_MAX: usize = 1_000_000;

/// Positions are rounded to this share of a small Gaussian's size: a thirtieth moves no edge.
const POSITION_SHARE: f64 = 1.0 / 32.0;

/// The Gaussian whose size counts as small: five in a hundred are smaller.
const SMALL: f64 = 0.05;

/// Step of log scales: sizes are off by at most 0.4 %.
const SCALE_STEP: f64 = 1.0 / 128.0;

/// Step of the entries of unit quaternions: 0.03 degrees at most.
const QUAT_STEP: f64 = 1.0 / 2048.0;

/// Step of opacity logits: opacities are off by at most 0.0005.
const LOGIT_STEP: f64 = 1.0 / 256.0;

/// Step of SH coefficients of degrees 0 and 1; those above have twice the step, since they are small and many.
const SH_STEP: f64 = 1.0 / 256.0;

/// Step of rotation vectors, radians, and of differences of quaternions.
const TURN_STEP: f64 = 1.0 / 4096.0;

/// Step of differences of log scales and logits.
const SHAPE_STEP: f64 = 1.0 / 256.0;

/// Step of weights of blocks of motion, a power of two.
const WEIGHT_STEP: f64 = 1.0 / 65_536.0;

/// Share of the moving rows that are faster than the brightest colour of velocities.
const FASTEST: f64 = 0.005;

/// Size of the picture of a scene without a camera, pixels, and its focal length as a share of the width.
const FREE_SIZE: [usize; 2] = [800, 600];
const FREE_FOCAL: f64 = 1.0;

/// The page's JSON.
#[derive(Debug, Serialize)]
pub struct Described {
    name: String,
    count: usize,
    total: usize,
    degree: usize,
    trained_degree: usize,
    moving: usize,
    arrays: Vec<Array>,
    clock: Option<Clock>,
    span: Option<[f64; 2]>,
    seen: Option<[f64; 2]>,
    middle: f64,
    full_speed: f64,
    shutter: Option<Shutter>,
    background: [f32; 3],
    near: f64,
    far: f64,
    eps2d: f64,
    antialiased: bool,
    up: [f64; 3],
    world: [f64; 16],
    cameras: Vec<Camera>,
    distance: f64,
    notes: Vec<String>,
}

/// A scene in two texts.
pub struct Packed {
    /// JSON without `<`, so that no name ends the element it is in.
    pub json: String,
    /// The block, gzip in base64.
    pub block: String,
}

/// A scene as JSON and block.
pub fn packed(scene: &dyn DynamicScene, presentation: &Presentation) -> Packed {
    let Presentation { name, options, middle: time, cameras, distance, shutter, world } = presentation;
    let span = shown_span(scene, cameras);
    let exposure = shutter.map_or(0.0, |shutter| shutter.exposure);
    let mut motion = span.and_then(|span| Motion::of(scene, span, exposure));
    let gaussians = motion.as_ref().map_or_else(|| scene.at(*time), |motion| motion.base.clone());
    let mut numbers = Numbers::of(&gaussians);
    let total = numbers.0.len();
    let mut notes = Vec::new();
    if total > GAUSSIANS_MAX {
        let kept = numbers.most_visible(GAUSSIANS_MAX);
        motion.iter_mut().for_each(|motion| motion.keep(&kept));
        numbers = Numbers(numbers.0.select(&kept));
        let left = total - kept.len();
        let are = agree(left, "is", "are");
        notes.push(format!("the least visible {} {are} left out of this page", counted(left, "Gaussian")));
    }
    let trained_degree = options.sh_degree.min(numbers.0.degree);
    let degree = if numbers.0.len() > WITH_SH_MAX { 0 } else { trained_degree };
    if degree < trained_degree {
        notes.push(format!("more than {WITH_SH_MAX} Gaussians: colours are the same from all sides in this page"));
    }
    let motion = motion.filter(|motion| motion.len() > 0);
    let mut block = Block::default();
    numbers.write(&mut block, degree);
    if let Some(motion) = &motion {
        write_motion(motion, &mut block, numbers.step());
    }
    let middle = numbers.middle();
    let (cameras, distance) = match cameras.is_empty() {
        true => free_camera(middle, numbers.radius(middle)),
        false => (cameras.clone(), distance.unwrap_or_else(|| guessed_distance(&cameras[0], options.near, middle))),
    };
    let described = Described {
        name: name.clone(),
        count: numbers.0.len(),
        total,
        degree,
        trained_degree,
        moving: motion.as_ref().map_or(0, Motion::len),
        arrays: block.arrays.clone(),
        span: motion.as_ref().and(span),
        seen: motion.as_ref().and(scene.span()),
        middle: *time,
        full_speed: motion.as_ref().map_or(0.0, |_| full_speed(scene, *time)),
        clock: motion.as_ref().map(|motion| motion.clock),
        shutter: shutter.filter(|_| motion.is_some()),
        background: options.background,
        near: options.near,
        far: options.far,
        eps2d: options.eps2d,
        antialiased: options.antialiased,
        up: up(&cameras),
        world: world.to_cols_array(),
        cameras,
        distance,
        notes,
    };
    let json = serde_json::to_string(&described).expect("numbers and names are JSON");
    Packed { json: json.replace('<', "\\u003c"), block: block.text() }
}

/// The first and the last time that are shown: those that the scene was trained for, and those of photos before and
/// after, as far as the scene can be asked.
fn shown_span(scene: &dyn DynamicScene, cameras: &[Camera]) -> Option<[f64; 2]> {
    let [first, last] = scene.span()?;
    let [earliest, latest] = scene.reach().unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
    let times = cameras.iter().filter_map(|camera| camera.time).map(|time| time.max(earliest).min(latest));
    Some(times.fold([first, last], |[first, last], time| [first.min(time), last.max(time)]))
}

/// The distance of the scene's middle before the first camera, at least a little.
fn guessed_distance(camera: &Camera, near: f64, middle: [f32; 3]) -> f64 {
    let c2w = DMat4::from_cols_array(&camera.c2w);
    let along = (DVec3::from_array(middle.map(f64::from)) - c2w.w_axis.truncate()).dot(c2w.z_axis.truncate());
    along.max(10.0 * near)
}

/// The speed of the brightest colour, scene units per unit of time.
fn full_speed(scene: &dyn DynamicScene, middle: f64) -> f64 {
    let span = scene.span().unwrap_or([middle; 2]);
    let times = [span[0], 0.5 * (span[0] + span[1]), span[1]];
    let mut speeds: Vec<f32> = Vec::new();
    for t in times {
        let velocity = to_host(scene.velocity(t).inner());
        let fast = velocity.as_chunks::<3>().0.iter().map(|v| v.iter().map(|x| x * x).sum::<f32>().sqrt());
        speeds.extend(fast.filter(|speed| *speed > 0.0));
    }
    speeds.sort_by(f32::total_cmp);
    let index = ((1.0 - FASTEST) * speeds.len() as f64) as usize;
    let full = speeds.get(index).or(speeds.last()).copied().unwrap_or(1.0);
    f64::from(full).max(1e-12)
}

/// Gaussians on the host, their rotations as unit quaternions.
struct Numbers(Splats);

impl Numbers {
    fn of(gaussians: &Gaussians) -> Self {
        let mut splats = splats_of(gaussians, None);
        splats.quats.iter_mut().for_each(normalise);
        Self(splats)
    }

    fn sorted_sizes(&self) -> Vec<f32> {
        let mut sizes: Vec<f32> = self.0.log_scales.iter().map(|s| (s.iter().sum::<f32>() / 3.0).exp()).collect();
        sizes.retain(|size| size.is_finite() && *size > 0.0);
        sizes.sort_by(f32::total_cmp);
        sizes
    }

    /// Step of positions, a power of two.
    fn step(&self) -> f64 {
        let sizes = self.sorted_sizes();
        let small = sizes.get((SMALL * sizes.len() as f64) as usize).copied().unwrap_or(1.0);
        (f64::from(small) * POSITION_SHARE).log2().floor().clamp(-60.0, 60.0).exp2()
    }

    /// The median of the means, axis by axis.
    fn middle(&self) -> [f32; 3] {
        [0, 1, 2].map(|axis| {
            let mut values: Vec<f32> = self.0.means.iter().map(|mean| mean[axis]).collect();
            values.retain(|value| value.is_finite());
            values.sort_by(f32::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(0.0)
        })
    }

    /// Half of the means are nearer to `middle` than this.
    fn radius(&self, middle: [f32; 3]) -> f64 {
        let distance = |mean: &[f32; 3]| (0..3).map(|a| (mean[a] - middle[a]).powi(2)).sum::<f32>().sqrt();
        let mut distances: Vec<f32> = self.0.means.iter().map(distance).collect();
        distances.retain(|distance| distance.is_finite());
        distances.sort_by(f32::total_cmp);
        f64::from(distances.get(distances.len() / 2).copied().unwrap_or(1.0)).max(1e-6)
    }

    /// The `count` rows of the largest opacity times area, ascending.
    fn most_visible(&self, count: usize) -> Vec<u32> {
        let seen = |row: usize| {
            let scales = &self.0.log_scales[row];
            let opacity = 1.0 / (1.0 + (-self.0.opacity_logits[row]).exp());
            // The area of the two longest axes.
            let area = scales.iter().sum::<f32>() - scales.iter().copied().fold(f32::INFINITY, f32::min);
            opacity.ln() + area
        };
        let mut order: Vec<(f32, u32)> = (0..self.0.len()).map(|row| (seen(row), row as u32)).collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut kept: Vec<u32> = order[..count].iter().map(|(_, row)| *row).collect();
        kept.sort_unstable();
        kept
    }

    fn write(&self, block: &mut Block, degree: usize) {
        let Splats { means, quats, log_scales, opacity_logits, sh, .. } = &self.0;
        block.floats("means", means.as_flattened(), self.step());
        block.shorts("logits", opacity_logits.iter().copied(), LOGIT_STEP);
        block.shorts("quats", quats.as_flattened().iter().copied(), QUAT_STEP);
        block.shorts("log_scales", log_scales.as_flattened().iter().copied(), SCALE_STEP);
        // Coefficient by coefficient, since one coefficient of many Gaussians compresses better than many of one.
        let (sh, stored) = (sh.as_flattened(), 3 * self.0.coefficients());
        let used = 3 * (degree + 1) * (degree + 1);
        let coarse = |number: usize, value: f32| match number < 12 {
            true => value,
            false => ((f64::from(value) / (2.0 * SH_STEP)).round() * 2.0 * SH_STEP) as f32,
        };
        let values =
            (0..used).flat_map(|number| (0..means.len()).map(move |row| coarse(number, sh[row * stored + number])));
        block.shorts("sh", values, SH_STEP);
    }
}

fn write_motion(motion: &Motion, block: &mut Block, step: f64) {
    let rows: Vec<f32> = motion.rows.iter().map(|row| *row as f32).collect();
    block.floats("rows", &rows, 1.0);
    block.floats("position", &motion.position, step);
    block.floats("weights", &motion.weights, WEIGHT_STEP);
    block.shorts("turn", motion.turn.iter().copied(), TURN_STEP);
    block.shorts("shape", motion.shape.iter().copied(), SHAPE_STEP);
}

/// Up in the world: the mean of what the cameras hold up, or of the first where these cancel each other.
fn up(cameras: &[Camera]) -> [f64; 3] {
    let own = |camera: &Camera| -DMat4::from_cols_array(&camera.c2w).y_axis.truncate();
    let mean: DVec3 = cameras.iter().map(own).sum();
    mean.try_normalize().or(cameras.first().map(own)).unwrap_or(DVec3::NEG_Y).to_array()
}

/// A camera that looks along z (forward in COLMAP's axes) at a scene that no data set shows.
fn free_camera(middle: [f32; 3], radius: f64) -> (Vec<Camera>, f64) {
    let distance = 2.5 * radius;
    let c2w = DMat4::from_translation(DVec3::from_array(middle.map(f64::from)) - distance * DVec3::Z);
    let [width, height] = FREE_SIZE;
    let (w, h) = (width as f64, height as f64);
    let k = [FREE_FOCAL * w, FREE_FOCAL * w, 0.5 * w, 0.5 * h];
    let (name, split) = ("start".into(), String::new());
    (vec![Camera { name, split, time: None, c2w: c2w.to_cols_array(), k, size: FREE_SIZE, photo: None }], distance)
}
