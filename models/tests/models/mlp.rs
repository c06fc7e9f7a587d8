//! The small network: the same from the same seed, layers as written down, gradients by differences.

use burn::module::Module;
use burn::tensor::Tensor;
use burn::tensor::activation::relu;
use gs_burn::ops::silu::silu;
use gs_burn::{NamedGradients, NamedParameter, map_parameters, named_parameters};
use gs_models::{Activation, Mlp, MlpConfig};
use gs_tests::devices::{everywhere, reference};
use gs_tests::finite_differences::assert_derivative;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_near, values};

use crate::cast;

fn config(sizes: &[usize], seed: u64) -> MlpConfig {
    MlpConfig::new(sizes.to_vec()).with_seed(seed)
}

#[test]
fn a_seed_is_a_network() {
    let place = reference();
    let numbers = |mlp: Mlp| named_parameters(&mlp).iter().flat_map(|p| values(&p.table)).collect::<Vec<f64>>();
    let network = |seed| numbers(config(&[4, 16, 16, 3], seed).init(&place.device));
    assert_eq!(network(1), network(1));
    assert_ne!(network(1), network(2));
    // He's variance, on the 256 weights in the middle: a standard error of 1 / sqrt(256 * 1.25).
    let middle = &network(3)[4 * 16 + 16..][..256];
    let variance = middle.iter().map(|x| x * x).sum::<f64>() / 256.0;
    assert!((variance * 16.0 / 2.0 - 1.0).abs() < 0.25, "variance {variance}");
    let mlp = config(&[4, 16, 3], 1).with_zero_last(true).init(&place.device);
    assert_eq!([mlp.inputs(), mlp.outputs(), mlp.num_params()], [4, 3, 4 * 16 + 16 + 16 * 3 + 3]);
    let paths: Vec<String> = named_parameters(&mlp).into_iter().map(|parameter| parameter.path).collect();
    assert_eq!(paths, ["layers.0.weight", "layers.0.bias", "layers.1.weight", "layers.1.bias"]);
}

/// Weights that a run drew with one version are those that it draws with another: computed apart from this program, by
/// SplitMix64 in Python.
#[test]
fn a_seed_draws_these_numbers() {
    const LAYERS: [&[u32]; 2] = [
        &[
            0xbe9f_8b27,
            0xbfae_f0fb,
            0x3f91_1743,
            0x3e70_3119,
            0xbe09_be34,
            0xbf35_6e53,
            0xbdb9_a2d3,
            0xbef8_f8b3,
            0xbf84_69a3,
            0xbe7b_91c3,
            0xbf8f_86d1,
            0x3fa6_7e01,
        ],
        &[0x3f83_104b, 0x3f68_d9cc, 0x3f64_4210, 0x3df2_3c8a, 0x3f6e_0b4c, 0xbed9_c45b, 0x3e95_64ce, 0x3f21_5bd6],
    ];
    for place in everywhere() {
        let mlp = config(&[3, 4, 2], 7).init(&place.device);
        for (layer, bits) in mlp.layers.iter().zip(LAYERS) {
            let weight = layer.weight.to_data();
            let drawn: Vec<u32> = weight.iter::<f32>().map(f32::to_bits).collect();
            assert_eq!(drawn, bits, "{}", place.name);
        }
    }
}

/// `forward` and its gradients to the bit: product, then bias as a row, layer by layer.
#[test]
fn forward_is_the_formula() {
    for place in everywhere() {
        let mut random = Random::new(2);
        let input = place.tensor(&random.values(5 * 40, -2.0, 2.0), [40, 5]);
        for activation in [Activation::Relu, Activation::Silu] {
            let mlp = config(&[5, 32, 32, 3], 9).with_activation(activation).init(&place.device);
            // Biases that are not zero, or adding them would show nothing.
            let mlp = map_parameters(cast(mlp, place), |path, table| match path.ends_with("bias") {
                true => table + 0.37,
                false => table,
            });
            // Weights `[in, out]` and biases `[1, out]`, in turn.
            let leaves: Vec<Tensor<2>> = named_parameters(&mlp)
                .into_iter()
                .map(|parameter| {
                    let shape = match parameter.shape.len() {
                        1 => [1, parameter.shape[0]],
                        _ => parameter.table.dims(),
                    };
                    place.leaf(&values(&parameter.table), shape)
                })
                .collect();
            let mut x = input.clone().matmul(leaves[0].clone()) + leaves[1].clone();
            for layer in leaves[2..].chunks(2) {
                x = match activation {
                    Activation::Relu => relu(x),
                    Activation::Silu => silu(x),
                };
                x = x.matmul(layer[0].clone()) + layer[1].clone();
            }
            let tracked = mlp.train();
            let found = tracked.forward(input.clone());
            assert_eq!(values(&found), values(&x), "{}: {activation:?}", place.name);

            let gradients = NamedGradients::take(&tracked, &mut found.square().sum().backward());
            let expected = x.square().sum().backward();
            for (parameter, leaf) in named_parameters(&tracked).iter().zip(&leaves) {
                let (name, path) = (&place.name, &parameter.path);
                let found = values(gradients.get(path).expect("a leaf"));
                assert_eq!(found, values(&leaf.grad(&expected).expect("tracked")), "{name}: {activation:?}: {path}");
            }
        }
    }
}

#[test]
fn a_zero_layer_says_nothing_and_can_learn() {
    for place in everywhere() {
        let mlp = cast(config(&[2, 8, 3], 1).with_zero_last(true).init(&place.device), place).train();
        let answer = mlp.forward(place.tensor(&[0.3, -2.0, 7.0, 0.1], [2, 2]));
        assert_eq!(values(&answer), [0.0; 6], "{}", place.name);
        let gradients = NamedGradients::take(&mlp, &mut answer.sum().backward());
        let last = values(gradients.get("layers.1.weight").expect("a leaf"));
        assert!(last.iter().any(|x| *x != 0.0), "{}: the last layer has no gradient", place.name);
    }
}

#[test]
fn shared_columns_are_columns() {
    let place = reference();
    let mut random = Random::new(3);
    let mlp = cast(config(&[5, 8, 2], 4).init(&place.device), place);
    let own = place.tensor(&random.values(12, -1.0, 1.0), [4, 3]);
    let shared = place.tensor(&random.values(2, -1.0, 1.0), [1, 2]);
    let all = Tensor::cat(vec![own.clone(), shared.clone().repeat_dim(0, 4)], 1);
    assert_near("shared", &values(&mlp.forward_shared(own, shared)), &values(&mlp.forward(all)), 1e-14);
}

#[test]
fn gradients_are_derivatives() {
    let place = reference();
    let mut random = Random::new(5);
    for activation in [Activation::Relu, Activation::Silu] {
        let mlp = cast(config(&[3, 6, 2], 6).with_activation(activation).init(&place.device), place);
        let input = place.tensor(&random.values(15, -1.0, 1.0), [5, 3]);
        let tracked = mlp.clone().train();
        let loss = tracked.forward(input.clone()).square().sum();
        let gradients = NamedGradients::take(&tracked, &mut loss.backward());
        for NamedParameter { path, table, .. } in named_parameters(&mlp) {
            let gradient = values(gradients.get(&path).expect("a leaf"));
            assert_derivative(&path, &values(&table), &gradient, 12, |x| {
                let moved = map_parameters(mlp.clone(), |found, table| match found == path {
                    true => place.tensor(x, table.dims()),
                    false => table,
                });
                values(&moved.forward(input.clone()).square().sum())[0]
            });
        }
    }
}

#[test]
fn a_configuration_is_json() {
    let config = config(&[3, 4, 2], 7).with_activation(Activation::Silu).with_zero_last(true);
    let json = serde_json::to_string(&config).expect("JSON");
    let read: MlpConfig = serde_json::from_str(&json).expect("the same JSON");
    assert_eq!(format!("{read:?}"), format!("{config:?}"));
}
