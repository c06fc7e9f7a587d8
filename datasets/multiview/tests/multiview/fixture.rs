//! The world of the motion tests, by a ray caster of its own.

use glam::{DMat3, DMat4, DVec3};
use gs_base::Intrinsics;
use gs_datasets::{LoadOptions, PoseConvention, Priors, RgbImage8, Scene, SceneFormat, Truth, View, load};
use gs_worlds::deblur::{self, DeblurOptions, write};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tempfile::TempDir;

pub const WIDTH: usize = 96;
pub const HEIGHT: usize = 72;

/// A textured sphere on a path.
pub struct Ball {
    pub radius: f64,
    pub path: fn(f64) -> DVec3,
    /// Spatial frequency of its texture, radians per unit; 0 paints it in one colour.
    pub texture: f64,
    /// How fast the texture turns about the vertical axis, radians per unit of time.
    pub spin: f64,
}

/// The scene and its cameras.
pub struct World {
    pub balls: Vec<Ball>,
    pub cameras: usize,
    pub frames: usize,
    /// Standard deviation of the sensor's noise, levels of 255.
    pub noise: f64,
    /// Share of the frame interval that the shutter is open.
    pub exposure: f64,
    /// Image size over 96 x 72.
    pub scale: usize,
}

impl World {
    /// One ball of radius 0.3 on a path, 9 cameras, 12 frames at times 0 to 1, noise of 1.5 levels, no blur.
    pub fn of(path: fn(f64) -> DVec3) -> Self {
        let ball = Ball { radius: 0.3, path, texture: 14.0, spin: 0.0 };
        Self { balls: vec![ball], cameras: 9, frames: 12, noise: 1.5, exposure: 0.0, scale: 1 }
    }

    /// Renders every view, with the truth about what moves.
    pub fn scene(&self) -> Scene {
        let last = (self.frames - 1).max(1) as f64;
        let train: Vec<View> = (0..self.cameras)
            .flat_map(|camera| (0..self.frames).map(move |frame| (camera, frame)))
            .map(|(camera, frame)| self.view(camera, frame, frame as f64 / last, self.exposure / last))
            .collect();
        Scene {
            train,
            held_out: Vec::new(),
            points: None,
            origin: DVec3::ZERO,
            format: SceneFormat::Transforms,
            poses: PoseConvention::of(SceneFormat::Transforms),
            warnings: Vec::new(),
            time_range: Some((0.0, 1.0)),
        }
    }

    /// Camera to world of a camera on an arc of 200 degrees, radius 3, high and low in turn.
    pub fn pose(&self, camera: usize) -> DMat4 {
        let share = camera as f64 / (self.cameras - 1).max(1) as f64 - 0.5;
        let (sin, cos) = (share * 200.0_f64.to_radians()).sin_cos();
        let eye = DVec3::new(3.0 * cos, 3.0 * sin, if camera.is_multiple_of(2) { 0.9 } else { 1.9 });
        let forward = (DVec3::new(0.0, 0.0, 0.4) - eye).normalize();
        let right = forward.cross(DVec3::Z).normalize();
        DMat4::from_cols(right.extend(0.0), forward.cross(right).extend(0.0), forward.extend(0.0), eye.extend(1.0))
    }

    fn view(&self, camera: usize, frame: usize, t: f64, tau: f64) -> View {
        let c2w = self.pose(camera);
        let (width, height) = (WIDTH * self.scale, HEIGHT * self.scale);
        let focal = 1.1 * width as f64;
        let mut rng = ChaCha8Rng::seed_from_u64((1000 * camera + frame) as u64);
        let times: Vec<f64> =
            if tau > 0.0 { (0..9).map(|i| t + tau * (i as f64 / 8.0 - 0.5)).collect() } else { vec![t] };
        let (mut data, mut moving) = (Vec::new(), Vec::new());
        for pixel in 0..width * height {
            let at = |offset: usize, size: usize| (offset as f64 + 0.5 - 0.5 * size as f64) / focal;
            let ray = DVec3::new(at(pixel % width, width), at(pixel / width, height), 1.0).normalize();
            let direction = c2w.transform_vector3(ray);
            let shots: Vec<(DVec3, bool)> =
                times.iter().map(|t| self.trace(c2w.w_axis.truncate(), direction, *t)).collect();
            let mean = shots.iter().map(|(color, _)| *color).sum::<DVec3>() / shots.len() as f64;
            data.extend((255.0 * mean).to_array().map(|value| (value + self.noise * normal(&mut rng)).round() as u8));
            moving.push(if shots.iter().any(|(_, moves)| *moves) { 255 } else { 0 });
        }
        View {
            name: format!("cam{camera:02}/{frame:04}"),
            image_path: "none.png".into(),
            c2w,
            intrinsics: Intrinsics { fx: focal, fy: focal, cx: 0.5 * width as f64, cy: 0.5 * height as f64 },
            width,
            height,
            time: Some(t),
            camera_id: Some(format!("cam{camera:02}")),
            image: RgbImage8 { width, height, data },
            fine: None,
            alpha: None,
            mask: None,
            exposure: (tau > 0.0).then_some(tau),
            priors: Priors::default(),
            truth: Truth { moving_union: Some(moving), ..Truth::default() },
            source: None,
        }
    }

    /// Colour (0 to 1) and whether it is a ball's.
    fn trace(&self, eye: DVec3, direction: DVec3, t: f64) -> (DVec3, bool) {
        let hits = self.balls.iter().filter_map(|ball| {
            let from = eye - (ball.path)(t);
            let b = from.dot(direction);
            let root = b * b - from.length_squared() + ball.radius * ball.radius;
            (root > 0.0 && -b - root.sqrt() > 0.0).then(|| (-b - root.sqrt(), ball))
        });
        if let Some((distance, ball)) = hits.min_by(|a, b| a.0.total_cmp(&b.0)) {
            let position = eye + distance * direction - (ball.path)(t);
            let wave = (ball.texture * (DMat3::from_rotation_z(ball.spin * t) * position)).to_array().map(f64::sin);
            let pattern = wave[0] * wave[1] + wave[2] * wave[0] * 0.7;
            return (DVec3::new(0.7, 0.35, 0.2) + 0.2 * pattern * DVec3::new(1.0, 0.8, -0.6), true);
        }
        let floor = if direction.z < 0.0 { eye - direction * (eye.z / direction.z) } else { 9.0 * direction };
        let tiles = (5.0 * floor.x).sin() * (5.0 * floor.y).sin() + 0.4 * (17.0 * floor.x + 11.0 * floor.y).sin();
        (DVec3::new(0.45, 0.5, 0.55) + 0.15 * tiles, false)
    }
}

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (rng.random::<f64>().max(1e-12), rng.random());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// The truth as masks for every view.
pub fn true_masks(scene: &Scene) -> Vec<Option<Vec<u8>>> {
    scene.train.iter().map(|view| view.truth.moving_union.clone()).collect()
}

/// A mask grown by one pixel over edges, or worn by one.
pub fn grown(mask: &[u8], width: usize, by: i32) -> Vec<u8> {
    let height = mask.len() / width;
    let near = |x: usize, y: usize| {
        let around = [(x, y), (x + 1, y), (x.wrapping_sub(1), y), (x, y + 1), (x, y.wrapping_sub(1))];
        let set = around.iter().map(|(u, v)| *u < width && *v < height && mask[v * width + u] != 0);
        if by > 0 { set.into_iter().any(|set| set) } else { set.into_iter().all(|set| set) }
    };
    (0..mask.len()).map(|pixel| if near(pixel % width, pixel / width) { 255 } else { 0 }).collect()
}

/// Across the cameras' arc, fast: 1.5 units, five radii.
pub fn straight(t: f64) -> DVec3 {
    DVec3::new(0.1, 1.5 * t - 0.75, 0.45)
}

/// The share of pixels that are set.
pub fn share(mask: &[u8]) -> f64 {
    mask.iter().filter(|value| **value != 0).count() as f64 / mask.len() as f64
}

/// A traced world with blur, in a folder that disappears with the value.
pub fn written(options: &DeblurOptions) -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    write(folder.path(), options, |_, _| {}).expect("written");
    folder
}

/// Sharp photos of a still world on an arc, and so many points of it.
pub fn still_world(cameras: usize, points: usize) -> Scene {
    let folder = written(&DeblurOptions {
        world: deblur::World::Lychee,
        width: 160,
        height: 120,
        cameras,
        frames: 1,
        exposure: 0.0,
        points,
        ..DeblurOptions::default()
    });
    load(folder.path(), &LoadOptions::default()).expect("a scene")
}
