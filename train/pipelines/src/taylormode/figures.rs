//! Figures of a moving scene beside image quality: its blurred images, velocities and exposure, and the cost of its
//! motion.

use burn::tensor::Tensor;
use gs_base::median;
use gs_burn::{Extras, Gaussians, RenderOptions, parameter_bytes, render_with};
use gs_datasets::{Scene, View};
use gs_models::taylormode::blur_path::{back_project, camera_velocity, to_world};
use gs_models::taylormode::{FixedOrder, Paths, Size, Summary, TaylorMotion};
use gs_models::{Pixels, sh_bands};

use super::blur::exposed;
use super::config::{BlurMode, VelocitySource};
use super::cues::stated_exposure;
use super::{Config, Step, Taylormode};
use gs_train::fit::figure::{Better, Figure, FigureTable, Figures};
use gs_train::fit::parameters::to_host;
use gs_train::fit::photos::{camera, mask_of, to_tensor};
use gs_train::run::memory::megabytes;
use gs_train::run::metrics::{mean, psnr_counted};

/// Samples of a measured blur, independent of training: enough that more change nothing visible up to about sixty
/// pixels of motion.
pub const MEASURE_SAMPLES: usize = 33;

/// Alpha below which a pixel's velocity is not measured.
const ALPHA_SEEN: f32 = 0.5;

/// Share of the largest true speed below which the direction of a velocity is not measured.
const SPEED_SHARE: f64 = 0.05;

/// The cost of a scene, compared with the same Gaussians at one fixed order.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionCost {
    /// Gaussians by order of their path, and all numbers of the scene.
    pub summary: Summary,
    /// Gaussians that move.
    pub moving: usize,
    /// Mean order of their own of moving Gaussians.
    pub mean_order: f64,
    /// Bodies.
    pub bodies: usize,
    /// Gaussians that move as their body does and store nothing of their own.
    pub followers: usize,
    /// Moving Gaussians by order of their rotation, from 0 on.
    pub rotation_orders: Vec<usize>,
    /// Kinks in every path.
    pub kinks: usize,
    /// Whether paths have the 3D remainder of Eq. 2.
    pub remainder: bool,
    /// Numbers of motion: coefficients of paths and rotations up to each Gaussian's order, and the 3D remainder.
    pub motion_parameters: usize,
    /// Numbers of motion at the orders `motion.order` and `motion.rotation_order` for every Gaussian.
    pub fixed_motion_parameters: usize,
    /// Gaussians by the degree of their view-dependent colour, from 0 on.
    pub sh_degrees: Vec<usize>,
    /// The fixed order of paths, `motion.order`.
    pub fixed_order: usize,
}

/// Measures the scene on some views.
pub fn figures(model: &Taylormode, gaussians: &Gaussians, scene: &Scene, views: &[View], at: &Step) -> Figures {
    let measured = Moving { model, gaussians, paths: model.motion.paths(&gaussians.means.val()), at };
    let cost = cost(model, gaussians, at.config);
    let mut numbers = Vec::new();
    let blurry: Vec<f64> = views.iter().filter_map(|view| measured.blurry_psnr(view)).collect();
    if let Some(mean) = mean(&blurry) {
        let figure = Figure::new("blurry_psnr", "blurry photo", mean, "dB").digits(2).better(Better::Higher);
        numbers.push(figure.note("as the scene forms it").headline());
    }
    numbers.extend(measured.velocities(views).figures());
    let exposure = model.exposure_on_host();
    // Exposures of the training photos; held-out views may have others.
    let stated = stated_exposure(&scene.train).or_else(|| stated_exposure(views));
    let error = stated.filter(|_| model.learns_exposure(at.config)).map(|stated| (exposure / stated - 1.0).abs());
    let note = error.map_or(String::new(), |error| format!("off by {:.1} %", 100.0 * error));
    numbers.push(Figure::new("exposure", "exposure", exposure, "").digits(4).note(note).headline());
    if let Some(error) = error {
        let figure = Figure::new("exposure_error", "exposure off by", 100.0 * error, "%").digits(1);
        numbers.push(figure.better(Better::Lower));
    }
    numbers.extend(cost.figures());
    Figures { numbers, tables: vec![cost.table(gaussians.len())] }
}

/// A moving scene under measurement.
struct Moving<'a> {
    model: &'a Taylormode,
    gaussians: &'a Gaussians,
    paths: Paths,
    at: &'a Step<'a>,
}

/// The velocities of a view's pixels, each of its `P` pixels a row.
struct Splatted {
    /// Eq. 4, world axes, scene units per unit of time, multiplied by alpha, `[P, 3]`.
    velocity: Tensor<2>,
    /// The velocity that the networks make of it (Eq. 5), `[P, 3]`.
    corrected: Tensor<2>,
    /// `[P, 1]`, 0 to 1.
    alpha: Tensor<2>,
    /// Camera z, scene units, `[P, 1]`.
    depth: Tensor<2>,
    /// World to camera, `[4, 4]`.
    viewmat: Tensor<2>,
}

/// The blurred image of a view over its share of the learned exposure, by exact integration, `[H, W, 3]` from 0 to 1.
pub fn form_blur(model: &Taylormode, gaussians: &Gaussians, view: &View, at: &Step) -> Tensor<3> {
    blur_over(gaussians, &model.motion, model.exposure_of(view), view, at)
}

/// The blurred image of a view over any exposure, in the data set's unit of time.
pub fn blur_over(gaussians: &Gaussians, motion: &TaylorMotion, exposure: f64, view: &View, at: &Step) -> Tensor<3> {
    exposed(gaussians, motion, (exposure, MEASURE_SAMPLES), view, at).clamp(0.0, 1.0)
}

/// Whether a held-out photo is blurry and has no sharp truth, so that it is compared with a formed blur: the data set
/// states an exposure, or training used a blur model.
pub fn is_blurry(view: &View, config: &Config) -> bool {
    let no_truth = view.truth.blurry.is_none();
    let stated = view.exposure.map(|exposure| exposure > 0.0);
    no_truth && view.time.is_some() && stated.unwrap_or(config.method.blur.mode != BlurMode::None)
}

impl Moving<'_> {
    /// PSNR of the blurred image, if the blurry photo is known beside a sharp truth, dB.
    fn blurry_psnr(&self, view: &View) -> Option<f64> {
        let blurry = view.truth.blurry.as_ref()?;
        let truth = to_tensor(view, &blurry.data, 3, &self.gaussians.device());
        let formed = form_blur(self.model, self.gaussians, view, self.at);
        Some(psnr_counted(formed, truth, mask_of(view, &self.gaussians.device())))
    }

    /// The scene as the blur's velocities are computed from it, at each pixel of a view.
    fn splatted(&self, view: &View) -> Splatted {
        let t = view.time.unwrap_or(0.0);
        let scene = self.paths.moved(self.gaussians, t);
        let camera = camera(view, &scene.device());
        let usual = self.at.facts.render_options(&self.at.config.render, 0);
        let options = RenderOptions { depth: true, background: [0.0; 3], ..usual };
        let extras = Extras { features: Some(self.paths.velocities(self.gaussians.len(), t)), ..Extras::default() };
        let rendering = render_with(&scene, &camera, &options, extras);
        let pixels = Pixels::all(view.width, view.height, &scene.device());
        let depth = pixels.of(rendering.expected_depth().expect("depth was asked for"));
        let positions = || to_world(back_project(&pixels, depth.clone(), &camera.intrinsics), &camera.viewmat);
        let velocity = pixels.of(rendering.features.clone().expect("features were given"));
        let at = self.paths.window.normalised(t);
        Splatted {
            corrected: self.model.pixel_velocity(at, || velocity.clone(), positions),
            velocity,
            alpha: pixels.of(rendering.alpha),
            depth,
            viewmat: camera.viewmat,
        }
    }

    /// The velocities of all views that have a truth; of every view if networks take part.
    fn velocities(&self, views: &[View]) -> Velocities {
        let mut found = Velocities::default();
        let has_networks = self.model.peano.is_some() || self.model.weights.is_some();
        for view in views {
            let truth = view.truth.velocity.as_ref().zip(view.truth.moving.as_ref());
            if truth.is_none() && !has_networks {
                continue;
            }
            let at = self.splatted(view);
            if let Some((truth, moving)) = truth {
                self.compare_with_truth(&at, truth, moving, &mut found);
            }
            if has_networks {
                self.add_networks(&at, &mut found);
            }
        }
        found
    }

    /// Angles and relative errors of speed over the pixels of moving surfaces; `truth` is `[H * W * 3]`.
    fn compare_with_truth(&self, at: &Splatted, truth: &[f32], moving: &[u8], found: &mut Velocities) {
        let blur = &self.at.config.method.blur;
        let seen = at.alpha.clone().clamp_min(f32::MIN_POSITIVE);
        let velocity = to_host(match (blur.mode, blur.velocity) {
            (BlurMode::Warp, VelocitySource::Network) => at.corrected.clone(),
            (BlurMode::Warp, VelocitySource::Taylor) => at.corrected.clone() / seen,
            _ => at.velocity.clone() / seen,
        });
        let alpha = to_host(at.alpha.clone());
        let truth = truth.as_chunks::<3>().0;
        let fastest = truth.iter().map(|v| length(*v)).fold(0.0, f64::max);
        for (pixel, true_velocity) in truth.iter().enumerate() {
            let speed = length(*true_velocity);
            if moving[pixel] == 0 || alpha[pixel] < ALPHA_SEEN || speed <= SPEED_SHARE * fastest {
                continue;
            }
            let seen = velocity.as_chunks::<3>().0[pixel];
            let dot: f64 = (0..3).map(|c| f64::from(seen[c]) * f64::from(true_velocity[c])).sum();
            let cosine = dot / (speed * length(seen)).max(f64::MIN_POSITIVE);
            found.angles.push(cosine.clamp(-1.0, 1.0).acos().to_degrees());
            found.speed_errors.push((length(seen) / speed - 1.0).abs());
        }
    }

    /// The parts of the warp's networks over the pixels whose splatted velocity is not small.
    fn add_networks(&self, at: &Splatted, found: &mut Velocities) {
        let (velocity, corrected) = (to_host(at.velocity.clone()), to_host(at.corrected.clone()));
        let (velocity, corrected) = (velocity.as_chunks::<3>().0, corrected.as_chunks::<3>().0);
        let fastest = velocity.iter().map(|v| length(*v)).fold(0.0, f64::max);
        let is_moving = |pixel: &usize| length(velocity[*pixel]) > SPEED_SHARE * fastest;
        let moving: Vec<usize> = (0..velocity.len()).filter(is_moving).collect();
        if self.model.peano.is_some() {
            found.speeds.extend(moving.iter().map(|pixel| length(velocity[*pixel])));
            let remainder = |pixel: &usize| length([0, 1, 2].map(|c| corrected[*pixel][c] - velocity[*pixel][c]));
            found.remainders.extend(moving.iter().map(remainder));
        }
        if let Some(network) = &self.model.weights {
            let samples = network.samples();
            let to_camera = camera_velocity(at.corrected.clone(), &at.viewmat);
            let weights = to_host(network.forward(at.depth.clone(), to_camera));
            let weights = moving.iter().flat_map(|pixel| &weights[pixel * samples..(pixel + 1) * samples]);
            found.weights_apart.extend(weights.map(|weight| (f64::from(*weight) * samples as f64 - 1.0).abs()));
        }
    }
}

/// Samples of velocities, one for each measured pixel.
#[derive(Default)]
struct Velocities {
    /// Angles to the true velocity, degrees.
    angles: Vec<f64>,
    /// Errors of the speed, as shares of the true speed.
    speed_errors: Vec<f64>,
    /// Lengths of the splatted velocity (Eq. 4), and of what Eq. 5 adds to it, scene units per unit of time.
    speeds: Vec<f64>,
    remainders: Vec<f64>,
    /// Distances of the weights of Eq. 11 from `1 / N`, as shares of `1 / N`; N a pixel.
    weights_apart: Vec<f64>,
}

impl Velocities {
    fn figures(self) -> impl Iterator<Item = Figure> {
        let percent = |key, name, share: f64| Figure::new(key, name, 100.0 * share, "%").digits(1);
        let truth = |figure: Figure| figure.better(Better::Lower).note("median over moving surfaces");
        let angle = median(self.angles)
            .map(|angle| truth(Figure::new("velocity_angle", "velocity off by", angle, "°").digits(1)));
        let speed = median(self.speed_errors).map(|error| truth(percent("speed_error", "speed off by", error)));
        let remainder = mean(&self.remainders).zip(mean(&self.speeds));
        let remainder =
            remainder.map(|(added, speed)| percent("peano_share", "Peano remainder of the velocity", added / speed));
        let apart = mean(&self.weights_apart).map(|apart| percent("weights_apart", "weights off 1/N by", apart));
        [angle, speed, remainder, apart].into_iter().flatten().map(Figure::headline)
    }
}

/// Numbers of Gaussians by the SH degree of their colour.
fn sh_degrees(gaussians: &Gaussians) -> Vec<usize> {
    let mut degrees = vec![0; gaussians.sh_degree() + 1];
    let sh = to_host(gaussians.sh.val().flatten::<2>(1, 2));
    sh.chunks_exact(3 * gaussians.sh.dims()[1]).for_each(|sh| degrees[sh_bands::degree(sh)] += 1);
    degrees
}

/// The cost of a scene.
pub fn cost(model: &Taylormode, gaussians: &Gaussians, config: &Config) -> MotionCost {
    let usize_of = |orders: &[u8]| -> Vec<usize> { orders.iter().map(|order| usize::from(*order)).collect() };
    let motion = &model.motion;
    // Rendering needs the 3D remainder; the other networks only form blur in training.
    let remainder = motion.remainder.as_ref().map_or(0, |network| parameter_bytes(network) / size_of::<f32>());
    let degrees = sh_degrees(gaussians);
    let blocks: usize = motion.orders.iter().chain(&motion.rotation_orders).map(|order| usize::from(*order)).sum();
    let size = Size {
        gaussians: gaussians.len(),
        sh_coefficients: degrees.iter().enumerate().map(|(degree, count)| count * (degree + 1).pow(2)).sum(),
        position_orders: usize_of(&motion.orders),
        rotation_orders: usize_of(&motion.rotation_orders),
        // All of the motion that is not in the orders of single Gaussians: bodies, contacts, jumps.
        network: remainder + motion.numbers() - 3 * blocks,
    };
    let choice = &config.method.motion;
    let fixed = FixedOrder {
        gaussians: size.gaussians,
        sh_coefficients: gaussians.sh.dims()[1],
        position: choice.order,
        rotation: choice.rotation_order,
    };
    MotionCost {
        summary: Summary::new(&size, &fixed),
        moving: motion.rows.len(),
        mean_order: size.position_orders.iter().sum::<usize>() as f64 / motion.rows.len().max(1) as f64,
        rotation_orders: histogram(&size.rotation_orders),
        kinks: motion.contacts().len(),
        remainder: motion.remainder.is_some(),
        motion_parameters: 3 * blocks + size.network,
        bodies: motion.bodies.len(),
        followers: motion.followers(),
        fixed_motion_parameters: 3 * size.gaussians * (fixed.position + fixed.rotation),
        sh_degrees: degrees,
        fixed_order: fixed.position,
    }
}

impl MotionCost {
    fn figures(&self) -> Vec<Figure> {
        let count = |key: &str, name: &str, value: usize| Figure::new(key, name, value as f64, "");
        let static_share = 100.0 * self.summary.static_share;
        let mean_order = format!("{static_share:.0} % static, mean order {:.2}", self.mean_order);
        vec![
            count("moving_gaussians", "moving Gaussians", self.moving).note(mean_order).headline(),
            Figure::new("static_share", "static", static_share, "%").digits(1),
            Figure::new("mean_order", "mean order of the moving", self.mean_order, "").digits(2),
            count("bodies", "bodies", self.bodies),
            count("followers", "Gaussians that follow a body", self.followers),
            count("kinks", "kinks in each path", self.kinks),
            count("remainder", "3D remainder", usize::from(self.remainder)),
            count("motion_numbers", "numbers of motion", self.motion_parameters).better(Better::Lower).column(),
            count("fixed_motion_numbers", "numbers of motion at one order", self.fixed_motion_parameters),
            count("numbers", "numbers", self.summary.parameters).better(Better::Lower),
            count("fixed_numbers", "numbers at one order and degree", self.summary.fixed_order_parameters),
        ]
    }

    /// A table of the scene's numbers, compared with the same Gaussians at one order and degree.
    fn table(&self, gaussians: usize) -> FigureTable {
        let all = gaussians.max(1) as f64;
        let Summary { histogram: orders, parameters, bytes, fixed_order_parameters: fixed, .. } = &self.summary;
        let moving: usize = orders.iter().enumerate().map(|(order, count)| order * count).sum();
        let counts = |of: &[usize]| of.iter().map(usize::to_string).collect::<Vec<_>>().join(" · ");
        let mut fixed_orders = vec![0; self.fixed_order + 1];
        fixed_orders[self.fixed_order] = gaussians;
        let mut fixed_degrees = vec![0; self.sh_degrees.len().max(1)];
        *fixed_degrees.last_mut().expect("one at least") = gaussians;
        let remainder = if self.remainder { "yes" } else { "no" };
        let rows = [
            ("Gaussians", gaussians.to_string(), gaussians.to_string()),
            ("numbers", parameters.to_string(), fixed.to_string()),
            ("of them motion", self.motion_parameters.to_string(), self.fixed_motion_parameters.to_string()),
            ("bytes", megabytes(*bytes as u64), megabytes(4 * *fixed as u64)),
            ("share static", format!("{:.1} %", 100.0 * self.summary.static_share), "0 %".into()),
            ("mean order of motion, over all", format!("{:.2}", moving as f64 / all), self.fixed_order.to_string()),
            ("Gaussians of order 0 · 1 · 2 · ...", counts(orders), counts(&fixed_orders)),
            ("moving Gaussians of rotation order 0 · 1 · ...", counts(&self.rotation_orders), String::new()),
            ("kinks in each path; remainder", format!("{}; {remainder}", self.kinks), String::new()),
            ("Gaussians of SH degree 0 · 1 · ...", counts(&self.sh_degrees), counts(&fixed_degrees)),
        ];
        FigureTable {
            title: "What the scene stores".into(),
            columns: vec![String::new(), "this scene".into(), "one order and degree for all".into()],
            rows: rows.into_iter().map(|(name, here, fixed)| vec![name.to_string(), here, fixed]).collect(),
        }
    }
}

fn histogram(orders: &[usize]) -> Vec<usize> {
    let mut counts = vec![0; orders.iter().max().map_or(0, |highest| highest + 1)];
    orders.iter().for_each(|order| counts[*order] += 1);
    counts
}

fn length(v: [f32; 3]) -> f64 {
    v.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt()
}
