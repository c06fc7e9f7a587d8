//! Eq. 11: weights are positive, sum to 1, start equal, and learn.

use gs_models::taylormode::BlurWeights;
use gs_tests::devices::everywhere;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_near, values};

#[test]
fn they_start_equal_and_always_sum_to_one() {
    for place in everywhere() {
        let mut random = Random::new(1);
        let depth = place.tensor(&random.values(6, 1.0, 9.0), [6, 1]);
        let velocity = place.tensor(&random.values(18, -3.0, 3.0), [6, 3]);
        let network = BlurWeights::new(7, 4.0, 3.0, 2, &place.device).map(|tensor| tensor.cast(place.dtype));
        assert_eq!(network.samples(), 7);
        let first = values(&network.forward(depth.clone(), velocity.clone()));
        assert_near(&place.name, &first, &[1.0 / 7.0; 42], 1e-7);

        let tracked = network.map(|tensor| {
            let noise = random.values(tensor.shape().num_elements(), -0.5, 0.5);
            (tensor.clone() + place.tensor(&noise, tensor.dims())).autodiff().require_grad()
        });
        let weights = tracked.forward(depth, velocity);
        let sums: Vec<f64> = values(&weights).chunks(7).map(|row| row.iter().sum()).collect();
        assert_near(&place.name, &sums, &[1.0; 6], 1e-6);
        assert!(values(&weights).iter().all(|w| *w > 0.0), "{}: a weight is not positive", place.name);
        let gradients = weights.square().sum().backward();
        for tensor in tracked.mlp.tensors() {
            let gradient = values(&tensor.grad(&gradients).expect("tracked"));
            assert!(gradient.iter().any(|g| *g != 0.0), "{}: a layer learns nothing", place.name);
        }
    }
}
