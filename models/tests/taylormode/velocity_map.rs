//! Eq. 5 and its ablation: nothing at the start, and a gradient to every weight that then learns.

use gs_models::taylormode::velocity_map::time_embedding;
use gs_models::taylormode::{DirectVelocity, PeanoMap};
use gs_tests::devices::{everywhere, reference};
use gs_tests::scenes::Random;
use gs_tests::tolerance::values;

#[test]
fn the_remainder_starts_at_nothing_and_learns() {
    for place in everywhere() {
        let mut random = Random::new(1);
        let map = place.tensor(&random.values(36, -4.0, 4.0), [12, 3]);
        let peano =
            PeanoMap::new(4.0, 2, &place.device).map(|tensor| tensor.cast(place.dtype).autodiff().require_grad());
        let last = peano.forward(map.clone(), 0.3);
        assert_eq!(values(&last), values(&map), "{}: V_final is not V_render", place.name);
        let wanted = map + 1.0;
        let first_loss = (last - wanted.clone()).square().mean();
        let gradients = first_loss.backward();
        let stepped = peano.map(|leaf| leaf.clone().inner() - leaf.grad(&gradients).expect("tracked") * 1e-4);
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
        let network =
            DirectVelocity::new([1.0, 2.0, 3.0], 5.0, 2.0, 3, &place.device).map(|tensor| tensor.cast(place.dtype));
        let places = place.tensor(&Random::new(4).values(12, -5.0, 5.0), [4, 3]);
        assert_eq!(values(&network.forward(places, 0.1)), [0.0; 12], "{}", place.name);
    }
}
