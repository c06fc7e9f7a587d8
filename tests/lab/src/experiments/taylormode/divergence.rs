//! How does a Taylor path diverge outside the window it was fitted in? Arithmetic alone, through the trainer's own
//! paths (`TaylorMotion`), so that their continuation beyond the window is measured.

use anyhow::Result;
use burn::tensor::{Device, Tensor, TensorData};
use glam::DVec3;
use gs_base::least_squares::least_squares;
use gs_models::taylormode::window::polynomials;
use gs_models::taylormode::{Kinks, Paths, Remainder, TimeWindow};
use gs_multiview::{Centre, Track, Trajectory};
use gs_pipelines::taylormode::initial_paths::{contacts, displacement_blocks};
use gs_train::fit::parameters::{from_host, to_host};

use crate::experiments::{Findings, Lab, Series, largest, smallest};

/// Fitted orders.
const ORDERS: std::ops::RangeInclusive<usize> = 0..=5;

/// Frames of the recording, at the midpoints of equal parts of the window.
const FRAMES: usize = 16;

/// Most kinks, as in the trainer's defaults.
const KINKS: usize = 2;

/// A position, or one vector coefficient.
type Row = [f64; 3];

struct Path {
    name: &'static str,
    position: fn(f64) -> Row,
}

/// Motions over the normalised time; the object's size is 1.
const PATHS: [Path; 4] = [
    Path { name: "sinusoid", position: |s| [(2.0 * s + 0.4).sin(), 0.3 * (2.0 * s + 0.4).sin(), 0.1 * s] },
    Path { name: "circle", position: |s| [(2.5 * s).cos(), (2.5 * s).sin(), 0.0] },
    Path { name: "ballistic", position: |s| [0.8 * s, 0.2 * s, 0.7 * s - 1.3 * s * s] },
    Path { name: "bounce", position: |s| [0.5 * s, 0.0, (2.0 * s).sin().abs()] },
];

pub fn run(_: &Lab, found: &mut Findings) -> Result<()> {
    let device = gs_burn::device::select("auto")?;
    let (mut outside, mut outside_rest, mut outside_kinked) = (Vec::new(), Vec::new(), Vec::new());
    for path in &PATHS {
        let fits: Vec<[Fit; 2]> =
            ORDERS.map(|order| [false, true].map(|rest| Fit::of(path, order, rest, &device))).collect();
        let [best, best_rest] =
            [0, 1].map(|rest| smallest(fits.iter().map(|pair| pair[rest].error_inside())).unwrap_or(f64::NAN));
        let kinked = Fit::with_kinks(path, &device);
        let best_kinked = kinked.as_ref().map(Fit::error_inside);
        let name = path.name;
        let what = format!("{name}: largest error inside the window by the best path, shares of the object's size");
        found.at_most(what, best.min(best_rest).min(best_kinked.unwrap_or(f64::NAN)), 0.01, "");
        let kinks = best_kinked.map_or("no kink is found".into(), |error| format!("{error:.4} with kinks"));
        found.note(format!("{name}: {best:.4} without the remainder, {best_rest:.4} with it, {kinks}."));
        let [line_mean, line_most] = fits[1][0].errors_outside();
        let ratio = |fit: &Fit| {
            let [mean, most] = fit.errors_outside();
            (mean / line_mean).max(most / line_most)
        };
        outside.extend(fits[2..].iter().map(|pair| ratio(&pair[0])));
        outside_rest.extend(fits[2..].iter().map(|pair| ratio(&pair[1])));
        outside_kinked.extend(kinked.as_ref().map(ratio));
        fan(found, path, &fits, kinked.as_ref());
    }
    let worst = "error over 1 < |s| < 3, mean and largest, against that of order 1, at worst";
    found.at_most(format!("orders 2 to 5: {worst}"), largest(outside), 1.1, "times");
    found.at_most(format!("the same with the remainder: {worst}"), largest(outside_rest), 1.1, "times");
    found.at_most(format!("the same with kinks: {worst}"), largest(outside_kinked), 1.1, "times");
    found.note(
        "With the remainder, the worst beyond the window is the bounce at order 5: eleven unknowns from sixteen frames \
         follow the kink so closely that they overshoot at the window's ends. The trainer's network is not free to do \
         so, and the remainder is in use only where the best polynomial leaves a pattern.",
    );
    let slopes = (1..=5).map(|order| remainder_slope(order, &device) - order as f64);
    found.above(
        "slope of the remainder in a log-log plot as t goes to t0, less the path's order, at worst",
        smallest(slopes),
        0.0,
        "",
    );
    Ok(())
}

/// A path fitted to the frames.
struct Fit {
    path: fn(f64) -> Row,
    constant: Row,
    motion: Paths,
}

impl Fit {
    /// Least squares over the frames.
    fn of(path: &Path, order: usize, with_rest: bool, device: &Device) -> Self {
        let shell = Remainder { weights: Tensor::zeros([1, 1], device), order };
        let basis = |s: f64| -> Vec<f64> {
            let rest = if with_rest { shell.functions(s) } else { Vec::new() };
            let moving = polynomials(s, order).into_iter().chain(rest).map(|sample| sample.value);
            std::iter::once(1.0).chain(moving).collect()
        };
        let times: Vec<f64> = (0..FRAMES).map(|frame| (frame as f64 + 0.5) * 2.0 / FRAMES as f64 - 1.0).collect();
        let rows: Vec<Vec<f64>> = times.iter().map(|s| basis(*s)).collect();
        let columns: Vec<Vec<f64>> =
            (0..rows[0].len()).map(|column| rows.iter().map(|row| row[column]).collect()).collect();
        let targets: Vec<DVec3> = times.iter().map(|s| (path.position)(*s).into()).collect();
        let solved: Vec<Row> = least_squares(&columns, &targets).into_iter().map(|x| x.to_array()).collect();
        let row = |vectors: &[Row]| vectors.iter().flatten().map(|x| *x as f32).collect::<Vec<f32>>();
        let window = TimeWindow { t0: 0.0, half: 1.0 };
        let mut motion = one_path(order, window, device);
        if order > 0 {
            motion.position = from_host(row(&solved[1..=order]), 3 * order, device);
        }
        motion.remainder = with_rest.then(|| {
            let weights = row(&solved[order + 1..]);
            Remainder { weights: from_host(weights.clone(), weights.len(), device), order }
        });
        Self { path: path.position, constant: solved[0], motion }
    }

    /// The trainer's procedure: order and kinks by BIC, expanded at the frame nearest the middle without a contact;
    /// `None` if no kink is found.
    fn with_kinks(path: &Path, device: &Device) -> Option<Self> {
        let frames = (0..FRAMES).map(|frame| (frame as f64 + 0.5) * 2.0 / FRAMES as f64 - 1.0);
        let seen = |t| Centre { t, position: (path.position)(t).into(), residual_px: 0.0, cameras: FRAMES };
        let centres: Vec<Centre> = frames.map(seen).collect();
        let found = Trajectory::fit(&centres, *ORDERS.end(), KINKS).filter(|found| !found.kinks.is_empty())?;
        let times = centres.iter().map(|centre| centre.t).filter(|t| found.is_undisturbed(*t, *t));
        let t0 = times.min_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        let window = TimeWindow { t0, half: 1.0 + t0.abs() };
        let order = found.order().max(1);
        let constant = found.position(t0).to_array();
        let tracks = [Track { centres, path: found }];
        let contacts = contacts(&tracks, &window, KINKS);
        let mut blocks = displacement_blocks(&tracks[0].path, window, order, &contacts);
        let jumps = blocks.split_off(3 * order);
        let mut motion = one_path(order, window, device);
        motion.position = from_host(blocks, 3 * order, device);
        let jumps = from_host(jumps, 3 * contacts.len(), device);
        motion.kinks = Some(Kinks::new(contacts, jumps));
        Some(Self { path: path.position, constant, motion })
    }

    fn error(&self, s: f64) -> f64 {
        let (moved, truth) = (to_host(self.motion.displacement(s)), (self.path)(s));
        (0..3).map(|c| (self.constant[c] + f64::from(moved[c]) - truth[c]).powi(2)).sum::<f64>().sqrt()
    }

    /// Largest error over `|s| <= 1`.
    fn error_inside(&self) -> f64 {
        (0..=100).map(|i| self.error(f64::from(i) / 50.0 - 1.0)).fold(0.0, f64::max)
    }

    /// Root mean square and largest error over `1 < |s| <= 3`.
    fn errors_outside(&self) -> [f64; 2] {
        let errors: Vec<f64> = (1..=80)
            .flat_map(|i| [1.0, -1.0].map(|side| side * (1.0 + f64::from(i) / 40.0)))
            .map(|s| self.error(s))
            .collect();
        let mean = errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64;
        [mean.sqrt(), errors.into_iter().fold(0.0, f64::max)]
    }
}

/// The paths of one Gaussian, all zero.
fn one_path(order: usize, window: TimeWindow, device: &Device) -> Paths {
    let rows = Tensor::from_data(TensorData::new(vec![0], [1]), device);
    let (position, rotation) = (Tensor::zeros([1, 3 * order], device), Tensor::zeros([1, 0], device));
    Paths { rows, position, rotation, window, remainder: None, kinks: None }
}

/// Slope of the logarithm of the remainder's displacement over that of the time, near t0.
fn remainder_slope(order: usize, device: &Device) -> f64 {
    let weights: Vec<f32> = (0..15).map(|i| 0.1 + 0.07 * i as f32).collect();
    let mut motion = one_path(0, TimeWindow { t0: 0.0, half: 1.0 }, device);
    motion.remainder = Some(Remainder { weights: Tensor::from_data(TensorData::new(weights, [1, 15]), device), order });
    let size = |t: f64| to_host(motion.displacement(t)).iter().map(|x| f64::from(*x).powi(2)).sum::<f64>().sqrt();
    let (near, far) = (1e-3, 1e-2);
    (size(far) / size(near)).ln() / (far / near).ln()
}

/// Error over |s| by order, for the highest order with the remainder, and with kinks.
fn fan(found: &mut Findings, path: &Path, fits: &[[Fit; 2]], kinked: Option<&Fit>) {
    let curve = |fit: &Fit| -> Vec<(f64, f64)> {
        let at = |i: i32| {
            let s = 3.0 * f64::from(i) / 120.0;
            // The larger of both sides, with a floor that limits the figure's range.
            (s, fit.error(s).max(fit.error(-s)).max(1e-6).log10())
        };
        (0..=120).map(at).collect()
    };
    let mut series: Vec<Series> =
        [1, 2, 3, 5].map(|order| Series::line(&format!("order {order}"), curve(&fits[order][0]))).to_vec();
    series.push(Series::line("order 5 and remainder", curve(&fits[5][1])));
    series.extend(kinked.map(|fit| Series::line("order and kinks by BIC", curve(fit))));
    let title = format!("{}: a Taylor path in its window (up to 1) and beyond", path.name);
    found.chart(path.name, title, ["|t - t0| / half window", "log10 of error / object size"], series);
}
