//! The rollout's gradient by recomputation fits into the memory of a small machine, at the size of a real scene.
//!
//! A process of its own: other tests would show in its memory.
#![recursion_limit = "256"]

use std::fs;

use burn::module::{Module, Param};
use burn::tensor::{DType, Device, Tensor, TensorData};
use gs_burn::device::select;
use gs_burn::map_parameters;
use gs_models::sparsedyn::{Ask, DynamicsField, DynamicsFieldConfig, Integrator, Rollout, RolloutOptions, State};

/// Moving Gaussians.
const GAUSSIANS: usize = 9_000;

/// Steps of the rollout.
const STEPS: usize = 30;

/// Units of a hidden layer; there are seven hidden layers, as in the light network of TRACE.
const WIDTH: usize = 128;

/// Bytes that the process may take at most. Stored activations of the field alone are 30 steps of 2 stages of 7 layers,
/// each 9,000 x 128 numbers of 4 bytes, kept before and after SiLU: 3.9 GB.
const MOST: u64 = 1_000_000_000;

/// A number of /proc/self/status, bytes; `None` where the system does not tell.
fn status(key: &str) -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(key))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? << 10)
}

/// The first CPU backend of the build.
fn device() -> Device {
    let name = if cfg!(feature = "flex") { "flex" } else { "ndarray" };
    select(name).unwrap_or_else(|error| panic!("{error}"))
}

/// Numbers from -1 to 1.
fn numbers(seed: u64, count: usize) -> Vec<f64> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    };
    (0..count).map(|_| next()).collect()
}

fn tensor(seed: u64, [rows, columns]: [usize; 2], size: f64, (device, dtype): (&Device, DType)) -> Tensor<2> {
    let values: Vec<f64> = numbers(seed, rows * columns).into_iter().map(|x| size * x).collect();
    Tensor::from_data(TensorData::new(values, [rows, columns]), (device, dtype))
}

/// The field of the paper with a last layer that moves things.
fn field(device: &Device, dtype: DType) -> DynamicsField {
    let config = DynamicsFieldConfig::new([0.0; 3], 1.0).with_width(WIDTH).with_layers(7).with_seed(3);
    let mut field = map_parameters(config.init(device), |_, table| table.cast(dtype));
    let last = field.mlp.layers.last_mut().expect("layers");
    last.weight = Param::from_tensor(tensor(5, [WIDTH, 12], 0.3, (device, dtype)));
    field.train()
}

/// The paper's Eq. 4: the field is asked at both stages of each step.
fn options() -> RolloutOptions {
    RolloutOptions { ask: Ask::Stage, integrator: Integrator::Rk2, step: 1.0 / 30.0, start: 0.0 }
}

/// A late frame and four earlier ones, as in a step of the long-horizon phase; the latest is the whole rollout away.
fn times() -> Vec<f64> {
    [STEPS, 3, 11, 17, 24].map(|step| step as f64 / 30.0).to_vec()
}

fn gradients(count: usize, place: (&Device, DType)) -> Vec<State> {
    let of = |seed: u64| State {
        positions: tensor(seed, [count, 3], 1.0, place),
        turns: tensor(seed + 50, [count, 4], 1.0, place),
    };
    (0..times().len() as u64).map(|index| of(100 + index)).collect()
}

fn values(tensor: &Tensor<2>) -> Vec<f64> {
    tensor.clone().into_data().iter::<f64>().collect()
}

#[test]
fn a_long_rollout_is_differentiated_in_a_gigabyte() {
    let device = device();
    let place = (&device, DType::F32);
    // 5 resets VmHWM (proc(5), since Linux 4.0).
    if fs::write("/proc/self/clear_refs", "5").is_err() || status("VmHWM:").is_none() {
        println!("skipped: this system does not tell the peak of memory");
        return;
    }
    let field = field(&device, DType::F32);
    let rollout = Rollout { field: &field, options: options() };
    let start = State::at_rest(tensor(7, [GAUSSIANS, 3], 1.0, place));
    let recorded = rollout.record(&start, &times());
    let (of_start, of_field) = recorded.backward(&gradients(GAUSSIANS, place));
    let peak = status("VmHWM:").expect("read above");
    println!("peak {} MB", peak / 1_000_000);
    assert!(peak < MOST, "{} MB", peak / 1_000_000);
    let all = of_field.iter().map(|(_, gradient)| gradient).chain([&of_start.positions]);
    for gradient in all {
        let values = values(gradient);
        assert!(values.iter().all(|x| x.is_finite()) && values.iter().any(|x| *x != 0.0));
    }
}
