//! Eq. 11: weights are positive, sum to 1, start equal, and learn.

use burn::module::Module;
use gs_burn::{NamedGradients, map_parameters};
use gs_models::taylormode::BlurWeightsConfig;
use gs_tests::devices::everywhere;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_near, values};

use crate::cast;

#[test]
fn they_start_equal_and_always_sum_to_one() {
    for place in everywhere() {
        let mut random = Random::new(1);
        let depth = place.tensor(&random.values(6, 1.0, 9.0), [6, 1]);
        let velocity = place.tensor(&random.values(18, -3.0, 3.0), [6, 3]);
        let network = BlurWeightsConfig::new(7, 4.0, 3.0).with_seed(2).init(&place.device);
        let network = cast(network, place);
        assert_eq!(network.samples(), 7);
        let first = values(&network.forward(depth.clone(), velocity.clone()));
        assert_near(&place.name, &first, &[1.0 / 7.0; 42], 1e-7);

        let tracked = map_parameters(network, |_, table| {
            let [rows, columns] = table.dims();
            table + place.tensor(&random.values(rows * columns, -0.5, 0.5), [rows, columns])
        });
        let tracked = tracked.train();
        let weights = tracked.forward(depth, velocity);
        let sums: Vec<f64> = values(&weights).chunks(7).map(|row| row.iter().sum()).collect();
        assert_near(&place.name, &sums, &[1.0; 6], 1e-6);
        assert!(values(&weights).iter().all(|w| *w > 0.0), "{}: a weight is not positive", place.name);
        let gradients = NamedGradients::take(&tracked, &mut weights.square().sum().backward());
        assert_eq!(gradients.iter().count(), 6);
        for (path, gradient) in gradients.iter() {
            assert!(values(gradient).iter().any(|g| *g != 0.0), "{}: {path} learns nothing", place.name);
        }
    }
}
