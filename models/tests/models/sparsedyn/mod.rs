//! SparseDynGS.

mod bodies;
mod integrators;
mod recorded;
mod refinement;
mod rollout;
mod turning;

use burn::module::Param;
use burn::tensor::{Tensor, TensorData};
use gs_burn::map_parameters;
use gs_models::sparsedyn::{DynamicsField, DynamicsFieldConfig, State};
use gs_tests::devices::Place;
use gs_tests::scenes::Random;

/// A reference point that is not the origin.
const CENTRE: [f64; 3] = [0.3, -0.2, 0.5];

/// A field of the paper's kind with random weights in every layer, in the float of `place`.
fn random_field(place: &Place, width: usize, size: f64) -> DynamicsField {
    let config = DynamicsFieldConfig::new(CENTRE, 2.0).with_width(width).with_layers(2);
    let field = config.with_seed(3).init(&place.device);
    let mut random = Random::new(5);
    let mut field = map_parameters(field, |_, table| table.cast(place.dtype));
    let last = field.mlp.layers.last_mut().expect("layers");
    let values = random.values(width * 12, -size, size);
    last.weight = Param::from_tensor(place.tensor(&values, [width, 12]));
    field
}

/// A field that gives the same `v, a, omega, beta` everywhere and at all times, lengths in scene units.
fn constant_field(place: &Place, [v, a, omega, beta]: [[f64; 3]; 4]) -> DynamicsField {
    let config = DynamicsFieldConfig::new(CENTRE, 2.0).with_width(4).with_layers(1);
    let mut field = map_parameters(config.init(&place.device), |_, table| table.cast(place.dtype));
    let scaled = |vector: [f64; 3]| vector.map(|x| x / 2.0);
    let values = [scaled(v), scaled(a), omega, beta].concat();
    let bias: Tensor<1> = Tensor::from_data(TensorData::new(values, [12]), (&place.device, place.dtype));
    field.mlp.layers.last_mut().expect("layers").bias = Some(Param::from_tensor(bias));
    field
}

/// Gaussians at random positions, as they begin.
fn start(place: &Place, count: usize) -> State {
    State::at_rest(place.tensor(&Random::new(7).values(3 * count, -1.0, 1.0), [count, 3]))
}
