//! Is a network that was trained better and faster than an optimisation of every pair of sweeps?

use std::path::Path;
use std::time::Instant;

use anyhow::Result;
use gs_driving::{FLOW_INTERVAL, INTERPOLATION_FRAMES, Snippet};
use gs_models::flux4d::fast_nsf::{FastNsfConfig, fit_flow};
use gs_pipelines::flux4d::flow::{FlowOfSweep, FlowScores, of_sweep};
use gs_pipelines::flux4d::saved::SavedNetwork;
use gs_pipelines::flux4d::sweep_flow::FIT_POINTS;

use super::trial::{Seen, network, seen, street};
use crate::experiments::lab::go_on;
use crate::experiments::{Findings, Lab, Series};

/// Iterations of the fits: a thousand, as its authors take, would be a quarter of an hour a sweep on two cores.
const ITERATIONS: [usize; 3] = [20, 60, 200];
const ITERATIONS_QUICK: [usize; 1] = [10];

/// How many times faster the network must be than the longest fit.
const FASTER: f64 = 3.0;

/// Seconds and errors of a way to find the flow.
#[derive(Default)]
struct Way {
    seconds: f64,
    sweeps: usize,
    scores: FlowScores,
}

impl Way {
    /// Seconds a sweep, EPE3D and EPE3D of moving points.
    fn values(&self) -> [f64; 3] {
        let figures = self.scores.figures();
        let value = |key: &str| figures.iter().find(|figure| figure.key == key).map_or(f64::NAN, |figure| figure.value);
        [self.seconds / self.sweeps.max(1) as f64, value("epe3d"), value("epe_moving")]
    }
}

pub fn run(lab: &Lab, found: &mut Findings) -> Result<()> {
    let saved = network(lab)?;
    let iterations: &[usize] = lab.either(&ITERATIONS, &ITERATIONS_QUICK);
    let (mut ours, mut fits) = (Way::default(), iterations.iter().map(|_| Way::default()).collect::<Vec<_>>());
    compare(lab, &lab.street(&street())?, &saved, &mut ours, iterations.iter().zip(&mut fits))?;
    let [own_seconds, own, own_moving] = ours.values();
    let said = |name: &str, [seconds, all, moving]: [f64; 3]| {
        format!("{name}: {seconds:.2} s a sweep, EPE3D {all:.3} m, of moving points {moving:.3} m.")
    };
    found.note(said("shipped network, with its lift", [own_seconds, own, own_moving]));
    let mut points = Vec::new();
    for (iterations, fit) in iterations.iter().zip(&fits) {
        let values = fit.values();
        found.note(said(&format!("fits of at most {iterations} iterations"), values));
        points.push((values[0], values[1]));
    }
    if let Some([seconds, all, moving]) = fits.last().map(Way::values) {
        found.above("EPE3D that it gains over the longest fit", all - own, 0.0, "m");
        found.above("of moving points", moving - own_moving, 0.0, "m");
        let faster = seconds / own_seconds;
        // A quick fit takes little time, and other work on the machine takes as much.
        if !lab.quick {
            found.at_least("times faster than the longest fit", faster, FASTER, "");
        }
    }
    let series = [
        Series::line_and_dots("a fit of each pair", points),
        Series::dots("shipped network", vec![(own_seconds, own)]),
    ];
    found.chart("", "Scene flow: error over seconds a sweep", ["seconds a sweep", "EPE3D, m"], series);
    Ok(())
}

fn compare<'a>(
    lab: &Lab,
    path: &Path,
    saved: &SavedNetwork,
    ours: &mut Way,
    fits: impl Iterator<Item = (&'a usize, &'a mut Way)>,
) -> Result<()> {
    let Seen { log, host, inferred, seconds } = seen(lab, path, saved)?;
    let snippet = Snippet::new(0, INTERPOLATION_FRAMES);
    ours.seconds += seconds;
    ours.sweeps += snippet.inputs.len();
    let mut pairs = Vec::new();
    for (place, pair) in snippet.inputs.windows(2).enumerate() {
        let Some(flow) = of_sweep(&log, &host, &inferred, place)? else { continue };
        ours.scores.add(&flow)?;
        let seconds = log.frames()[pair[1]].time - log.frames()[pair[0]].time;
        pairs.push((flow, host.labelled_sweep(&log, pair[1])?.points, seconds));
    }
    for (iterations, fit) in fits {
        let config = FastNsfConfig { iterations: *iterations, points: Some(FIT_POINTS), ..FastNsfConfig::default() };
        for (flow, target, seconds) in &pairs {
            go_on()?;
            let begun = Instant::now();
            let fitted = fit_flow(&flow.points, target, &config, &lab.device)?;
            fit.seconds += begun.elapsed().as_secs_f64();
            fit.sweeps += 1;
            let share = (FLOW_INTERVAL / seconds) as f32;
            let predicted: Vec<[f32; 3]> = fitted.flow.iter().map(|flow| flow.map(|x| share * x)).collect();
            fit.scores.add(&FlowOfSweep { predicted, ..flow.clone() })?;
        }
    }
    Ok(())
}
