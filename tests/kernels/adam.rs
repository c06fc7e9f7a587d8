//! `gs_burn::ops::adam`.

use burn::tensor::{DType, Tensor};
use gs_burn::ops::adam::{AdamConfig, FirstColumns, adam_step};
use gs_tests::devices::everywhere;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{FORWARD_F32, FORWARD_F64, assert_near, values};

fn config(step: u64) -> AdamConfig {
    AdamConfig { lr: 0.125, beta1: 0.9, beta2: 0.999, eps: 1e-15, step, first_columns: None }
}

/// Whatever its size, the first gradient moves a parameter by the learning rate.
#[test]
fn first_step_is_the_learning_rate() {
    for place in everywhere() {
        let gradient = place.tensor(&[1e-6, -1e-3, 5.0, -1e4, 0.0], [5]);
        let zeros = || gradient.zeros_like();
        let (param, ..) = adam_step(place.tensor(&[1.0; 5], [5]), gradient.clone(), zeros(), zeros(), &config(1));
        assert_near(&place.name, &values(&param), &[0.875, 1.125, 0.875, 1.125, 1.0], FORWARD_F32);
    }
}

/// Ten steps against the formula in plain arithmetic, for tensors below and above a block, of one to three dimensions.
#[test]
fn ten_steps_are_the_formula() {
    fn check<const D: usize>(shape: [usize; D]) {
        let count = shape.iter().product();
        let mut random = Random::new(1);
        let start = random.values(count, -1.0, 1.0);
        let gradients: Vec<Vec<f64>> = (0..10).map(|_| random.values(count, -1.0, 1.0)).collect();
        let (mut param, mut m, mut v) = (start.clone(), vec![0.0; count], vec![0.0; count]);
        for (t, gradient) in gradients.iter().enumerate() {
            let AdamConfig { lr, beta1, beta2, eps, .. } = config(0);
            let [mean, spread] = [beta1, beta2].map(|beta| 1.0 - beta.powi(t as i32 + 1));
            for i in 0..count {
                m[i] = beta1 * m[i] + (1.0 - beta1) * gradient[i];
                v[i] = beta2 * v[i] + (1.0 - beta2) * gradient[i] * gradient[i];
                param[i] -= lr * (m[i] / mean) / ((v[i] / spread).sqrt() + eps);
            }
        }
        for place in everywhere() {
            let zeros = || Tensor::<D>::zeros(shape, (&place.device, place.dtype));
            let mut state = (place.tensor(&start, shape), zeros(), zeros());
            for (t, gradient) in gradients.iter().enumerate() {
                state = adam_step(state.0, place.tensor(gradient, shape), state.1, state.2, &config(t as u64 + 1));
            }
            let bound = if place.dtype == DType::F64 { FORWARD_F64 } else { FORWARD_F32 };
            assert_near(&format!("param {shape:?} on {}", place.name), &values(&state.0), &param, bound);
            assert_near(&format!("m {shape:?} on {}", place.name), &values(&state.1), &m, bound);
            assert_near(&format!("v {shape:?} on {}", place.name), &values(&state.2), &v, bound);
        }
    }
    check([7]);
    check([300, 3]);
    check([500, 16, 3]);
    check([0, 3]);
}

#[test]
fn a_shared_tensor_keeps_its_values() {
    for place in everywhere() {
        let param = place.tensor(&[1.0, 2.0], [2]);
        let ones = || param.ones_like();
        adam_step(param.clone(), ones(), ones(), ones(), &config(1));
        assert_eq!(values(&param), [1.0, 2.0], "{}", place.name);
    }
}

/// The first columns of every row have their own rate; rows, moments and the other columns are as with one rate.
#[test]
fn first_columns_have_a_rate_of_their_own() {
    const SHAPE: [usize; 2] = [3000, 48];
    let [start, gradient] = [1, 2].map(|seed| Random::new(seed).values(3000 * 48, -1.0, 1.0));
    for place in everywhere() {
        let step = |config: &AdamConfig| {
            let zeros = || Tensor::<2>::zeros(SHAPE, (&place.device, place.dtype));
            let (param, ..) =
                adam_step(place.tensor(&start, SHAPE), place.tensor(&gradient, SHAPE), zeros(), zeros(), config);
            values(&param)
        };
        let first_columns = Some(FirstColumns { row: 48, count: 3, lr: 0.5 });
        let found = step(&AdamConfig { first_columns, ..config(1) });
        let [fast, slow] = [step(&AdamConfig { lr: 0.5, ..config(1) }), step(&config(1))];
        let expected: Vec<f64> = (0..3000 * 48).map(|i| if i % 48 < 3 { fast[i] } else { slow[i] }).collect();
        assert_eq!(found, expected, "{}", place.name);
    }
}
