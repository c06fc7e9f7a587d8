//! The small network: the same from the same seed, layers as written down, gradients by differences.

use burn::tensor::Tensor;
use gs_models::network::Mlp;
use gs_tests::devices::{everywhere, reference};
use gs_tests::finite_differences::assert_derivative;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_near, values};

#[test]
fn a_seed_is_a_network() {
    let place = reference();
    let network = |seed| {
        let tensors = Mlp::new(&[4, 16, 16, 3], seed, false, &place.device).tensors();
        tensors.iter().flat_map(values).collect::<Vec<f64>>()
    };
    assert_eq!(network(1), network(1));
    assert_ne!(network(1), network(2));
    // He's variance, on the 256 weights in the middle: a standard error of 1 / sqrt(256 * 1.25).
    let middle = &network(3)[4 * 16 + 16..][..256];
    let variance = middle.iter().map(|x| x * x).sum::<f64>() / 256.0;
    assert!((variance * 16.0 / 2.0 - 1.0).abs() < 0.25, "variance {variance}");
    let mlp = Mlp::new(&[4, 16, 3], 1, true, &place.device);
    assert_eq!([mlp.inputs(), mlp.outputs(), mlp.parameters()], [4, 3, 4 * 16 + 16 + 16 * 3 + 3]);
}

#[test]
fn a_zero_layer_says_nothing_and_can_learn() {
    for place in everywhere() {
        let mlp = Mlp::new(&[2, 8, 3], 1, true, &place.device)
            .map(|tensor| tensor.cast(place.dtype).autodiff().require_grad());
        let answer = mlp.forward(place.tensor(&[0.3, -2.0, 7.0, 0.1], [2, 2]));
        assert_eq!(values(&answer), [0.0; 6], "{}", place.name);
        let gradients = answer.sum().backward();
        let last = values(&mlp.weights[1].grad(&gradients).expect("tracked"));
        assert!(last.iter().any(|x| *x != 0.0), "{}: the last layer has no gradient", place.name);
    }
}

#[test]
fn shared_columns_are_columns() {
    let place = reference();
    let mut random = Random::new(3);
    let mlp = Mlp::new(&[5, 8, 2], 4, false, &place.device).map(|tensor| tensor.cast(place.dtype));
    let own = place.tensor(&random.values(12, -1.0, 1.0), [4, 3]);
    let shared = place.tensor(&random.values(2, -1.0, 1.0), [1, 2]);
    let all = Tensor::cat(vec![own.clone(), shared.clone().repeat_dim(0, 4)], 1);
    assert_near("shared", &values(&mlp.forward_shared(own, shared)), &values(&mlp.forward(all)), 1e-14);
}

#[test]
fn gradients_are_derivatives() {
    let place = reference();
    let mut random = Random::new(5);
    let mlp = Mlp::new(&[3, 6, 2], 6, false, &place.device).map(|tensor| tensor.cast(place.dtype));
    let input = place.tensor(&random.values(15, -1.0, 1.0), [5, 3]);
    let shapes: Vec<[usize; 2]> = mlp.tensors().iter().map(Tensor::dims).collect();
    let numbers: Vec<Vec<f64>> = mlp.tensors().iter().map(values).collect();
    let tracked = mlp.map(|tensor| tensor.autodiff().require_grad());
    let gradients = tracked.forward(input.clone()).square().sum().backward();
    for (i, leaf) in tracked.tensors().into_iter().enumerate() {
        let gradient = values(&leaf.grad(&gradients).expect("tracked"));
        assert_derivative(&format!("tensor {i}"), &numbers[i], &gradient, 12, |x| {
            let mut tensors = mlp.tensors();
            tensors[i] = place.tensor(x, shapes[i]);
            values(&Mlp::from_tensors(tensors).forward(input.clone()).square().sum())[0]
        });
    }
}
