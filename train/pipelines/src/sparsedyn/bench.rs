//! A step of this pipeline by stage, for `gsburn bench --rollout`. The cost of the rollout is linear in its length and
//! in the Gaussians that move; that of the image depends on neither.

use std::time::{Duration, Instant};

use burn::module::Module;
use burn::tensor::Tensor;
use gs_burn::{Camera, Gaussians, RenderOptions, render};
use gs_models::sparsedyn::{Rollout, State};

use super::Sparsedyn;
use super::clock::Clock;
use super::config::{AskChoice, DynamicsConfig};
use super::model::Frame;
use super::motion::Moved;
use gs_train::config::LossConfig;
use gs_train::fit::losses::photometric;

/// Steps of the rollouts. The paper's longest has 30.
const HORIZONS: [usize; 4] = [5, 15, 30, 60];

/// Gaussians that move, as far as there are so many.
const MOVING: [usize; 3] = [1000, 2000, 4000];

/// The stages of a step.
const STAGES: [&str; 5] = ["rollout", "render", "loss", "backward", "rollout, backward"];

/// Times the stages on some of `gaussians` and gives `print` the lines of a table: medians of `repeat` times,
/// milliseconds; last the rollout both ways for each of its steps and 1000 Gaussians.
pub fn rollout_table(gaussians: &Gaussians, camera: &Camera, repeat: u32, print: impl Fn(String)) {
    let target = render(gaussians, camera, &RenderOptions::default()).color * 0.5 + 0.25;
    let dynamics = DynamicsConfig { ask: AskChoice::Step, ..DynamicsConfig::default() };
    print(format!("field of {} layers of {} asked at every step; ms", dynamics.layers, dynamics.width));
    let heads: String = STAGES.iter().map(|stage| format!(" {stage:>18}")).collect();
    print(format!("{:>7} {:>6}{heads} {:>18}", "moving", "steps", "a step of 1000"));
    for moving in MOVING.into_iter().filter(|moving| *moving <= gaussians.len()) {
        let model = model(gaussians, moving, &dynamics);
        for steps in HORIZONS {
            let timed = || step(&model, gaussians, (camera, &target), steps as f64);
            timed();
            let times: Vec<[Duration; 5]> = (0..repeat).map(|_| timed()).collect();
            let medians = median(&times).map(|time| time.as_secs_f64() * 1e3);
            let columns: String = medians.iter().map(|time| format!(" {time:>18.2}")).collect();
            let each = (medians[0] + medians[4]) * 1e3 / (steps * moving) as f64;
            print(format!("{moving:>7} {steps:>6}{columns} {each:>18.1}"));
        }
    }
}

/// A field that moves `moving` Gaussians, spread evenly over all; its steps have the length 1.
fn model(gaussians: &Gaussians, moving: usize, dynamics: &DynamicsConfig) -> Sparsedyn {
    let rows: Vec<u32> = (0..moving).map(|index| (index * gaussians.len() / moving) as u32).collect();
    let frame = Frame {
        clock: Clock::default(),
        labels: vec![-1; rows.len()],
        rows,
        bodies: Vec::new(),
        knots: 0,
        start: 0.0,
        span: [0.0, 1.0],
        step: 1.0,
        centre: [0.0, 0.0, 6.0],
        length: 3.0,
    };
    Sparsedyn::new(frame, dynamics, 0, &gaussians.device())
}

/// The times of the stages of one step, whose photo is `steps` steps from the first frame.
fn step(
    model: &Sparsedyn,
    gaussians: &Gaussians,
    (camera, target): (&Camera, &Tensor<3>),
    steps: f64,
) -> [Duration; 5] {
    let device = gaussians.device();
    let tracked = gaussians.clone().train();
    let field = model.field.clone().expect("the model of a rollout has a field").train();
    let first = model.first_positions(&tracked).inner();
    device.sync().expect("a device that computed before");
    let mut begun = Instant::now();
    let mut lap = || {
        device.sync().expect("a device that computed before");
        let time = begun.elapsed();
        begun = Instant::now();
        time
    };
    let recorded = Rollout { field: &field, options: model.options }.record(&State::at_rest(first), &[steps]);
    let leaf = recorded.states[0].clone().leaf();
    let rolled = lap();
    let placed = model.placed(&tracked, &Moved { state: leaf.clone(), growth: None });
    let color = render(&placed, camera, &RenderOptions::default()).color;
    let rendered = lap();
    let loss = photometric(color, target.clone(), None, &LossConfig::default());
    let compared = lap();
    let mut graph = loss.backward();
    let of_state = leaf.take_gradient(&mut graph);
    drop(graph);
    let differentiated = lap();
    drop(recorded.backward(&[of_state]));
    [rolled, rendered, compared, differentiated, lap()]
}

/// The median of each stage.
fn median(times: &[[Duration; 5]]) -> [Duration; 5] {
    std::array::from_fn(|stage| {
        let mut own: Vec<Duration> = times.iter().map(|times| times[stage]).collect();
        own.sort();
        own[own.len() / 2]
    })
}
