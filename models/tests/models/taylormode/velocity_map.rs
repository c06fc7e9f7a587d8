//! Eq. 5 and its ablation: nothing at the start, and a gradient to every weight that then learns.

use burn::module::Module;
use gs_burn::{NamedGradients, map_parameters};
use gs_models::taylormode::velocity_map::time_embedding;
use gs_models::taylormode::{DirectVelocityConfig, PeanoMapConfig};
use gs_tests::devices::{everywhere, reference};
use gs_tests::scenes::Random;
use gs_tests::tolerance::values;

use crate::cast;

#[test]
fn the_remainder_starts_at_nothing_and_learns() {
    for place in everywhere() {
        let mut random = Random::new(1);
        let map = place.tensor(&random.values(36, -4.0, 4.0), [12, 3]);
        let peano = cast(PeanoMapConfig::new(4.0).with_seed(2).init(&place.device), place).train();
        let last = peano.forward(map.clone(), 0.3);
        assert_eq!(values(&last), values(&map), "{}: V_final is not V_render", place.name);
        let wanted = map + 1.0;
        let first_loss = (last - wanted.clone()).square().mean();
        let gradients = NamedGradients::take(&peano, &mut first_loss.backward());
        let stepped = map_parameters(peano.valid(), |path, table| {
            table - gradients.get(path).expect("every leaf has one").clone() * 1e-4
        });
        let loss = values(&(stepped.forward(wanted.clone() - 1.0, 0.3) - wanted).square().mean())[0];
        assert!(loss < values(&first_loss)[0], "{}: a step downhill leads to {loss}", place.name);
    }
}

#[test]
fn the_embedding_tells_times_apart() {
    let place = reference();
    let like = place.tensor(&[0.0], [1, 1]);
    let at = |s: f64| values(&time_embedding(s, &like));
    assert_eq!(at(0.0), [0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0]);
    let near: f64 = at(0.5).iter().zip(at(0.55)).map(|(a, b)| (a - b).powi(2)).sum();
    assert!(near > 0.1, "0.5 and 0.55 are {near} apart");
}

#[test]
fn a_velocity_of_network_alone_starts_at_rest() {
    for place in everywhere() {
        let network = DirectVelocityConfig::new([1.0, 2.0, 3.0], 5.0, 2.0).with_seed(3).init(&place.device);
        let network = cast(network, place);
        let positions = place.tensor(&Random::new(4).values(12, -5.0, 5.0), [4, 3]);
        assert_eq!(values(&network.forward(positions, 0.1)), [0.0; 12], "{}", place.name);
    }
}
