//! `gs_burn::named_parameters`.

use burn::module::{Module, Param};
use burn::tensor::Tensor;
use gs_burn::named_parameters::all_finite;
use gs_burn::{
    Gaussians, NamedGradients, RowMap, map_parameters, named_parameters, parameter_bytes, try_map_parameters,
};
use gs_tests::devices::reference;
use gs_tests::scenes::Random;
use gs_tests::tolerance::values;

use super::gaussians;

#[derive(Module, Debug)]
struct Inner {
    weights: Vec<Param<Tensor<2>>>,
    constant: Tensor<1>,
    unit: f64,
}

#[derive(Module, Debug)]
struct Model {
    gaussians: Gaussians,
    inner: Option<Inner>,
    none: Option<Inner>,
}

/// Three Gaussians and two matrices, outside autodiff.
fn model() -> Model {
    let (mut random, place) = (Random::new(5), reference());
    let mut weight = |shape| Param::from_tensor(random.leaf(place, shape, -1.0, 1.0).inner());
    let weights = vec![weight([2, 4]), weight([4, 1])];
    let inner = Inner { weights, constant: Tensor::ones([2], &place.device.clone().autodiff()), unit: 2.0 };
    Model { gaussians: gaussians(3), inner: Some(inner), none: None }
}

const PATHS: [&str; 7] = [
    "gaussians.means",
    "gaussians.quats",
    "gaussians.log_scales",
    "gaussians.opacity_logits",
    "gaussians.sh",
    "inner.weights.0",
    "inner.weights.1",
];

#[test]
fn parameters_have_a_path_a_shape_and_bytes() {
    let model = model();
    let found = named_parameters(&model);
    assert_eq!(found.iter().map(|parameter| parameter.path.as_str()).collect::<Vec<_>>(), PATHS);
    let shapes: Vec<&[usize]> = found.iter().map(|parameter| parameter.shape.as_slice()).collect();
    let expected: [&[usize]; 7] = [&[3, 3], &[3, 4], &[3, 3], &[3], &[3, 4, 3], &[2, 4], &[4, 1]];
    assert_eq!(shapes, expected);
    assert_eq!(found[3].table.dims(), [3, 1]);
    assert_eq!(found[4].table.dims(), [3, 12]);
    assert_eq!(values(&found[4].table), values(&model.gaussians.sh.val()));
    // 9 + 12 + 9 + 3 + 36 + 8 + 4 numbers of 8 bytes.
    assert_eq!(parameter_bytes(&model), 8 * 81);
}

#[test]
fn replacing_keeps_ids_ranks_and_constants() {
    let model = model();
    let id = model.gaussians.sh.id;
    let doubled = map_parameters(model.clone(), |_, table| table * 2.0);
    assert_eq!(doubled.gaussians.sh.id, id);
    assert_eq!(doubled.gaussians.sh.dims(), [3, 4, 3]);
    assert_eq!(values(&doubled.gaussians.sh.val()), values(&(model.gaussians.sh.val() * 2.0)));
    let inner = doubled.inner.expect("present before");
    assert_eq!((values(&inner.constant), inner.unit), (vec![1.0; 2], 2.0));

    let wider = map_parameters(model, |path, table| match path {
        "gaussians.sh" => Tensor::cat(vec![table.clone(), table.zeros_like(), table.narrow(1, 0, 3)], 1),
        _ => table,
    });
    assert_eq!(wider.gaussians.sh.dims(), [3, 9, 3]);
}

#[test]
#[should_panic(expected = "13 columns do not fit the axes of gaussians.sh")]
fn columns_that_fit_no_axis_are_refused() {
    map_parameters(model(), |path, table| match path {
        "gaussians.sh" => Tensor::cat(vec![table.clone(), table.narrow(1, 0, 1)], 1),
        _ => table,
    });
}

#[test]
fn leaves_stay_leaves_and_plain_tensors_plain() {
    let plain = map_parameters(model(), |_, table| table);
    assert!(!plain.gaussians.means.is_autodiff());
    // Nevertheless marked as learned: `train` makes leaves of them.
    let tracked = map_parameters(plain.train(), |_, table| table + 1.0);
    assert!(tracked.gaussians.sh.is_require_grad());
    let loss = tracked.gaussians.sh.val().sum();
    let gradients = NamedGradients::take(&tracked, &mut loss.backward());
    assert_eq!(values(gradients.get("gaussians.sh").expect("a leaf")), [1.0; 36]);
    assert_eq!(values(gradients.get("inner.weights.0").expect("zero, not absent")), [0.0; 8]);
    assert_eq!(gradients.iter().count(), PATHS.len());
}

#[test]
fn the_first_error_ends_the_walk() {
    let mut calls = 0;
    let answer = try_map_parameters(model(), |parameter| {
        calls += 1;
        if parameter.shape == [3, 4] { Err(parameter.path) } else { Ok(parameter.table) }
    });
    assert_eq!((answer.err().as_deref(), calls), (Some("gaussians.quats"), 2));
}

#[test]
fn one_number_tells_whether_all_are_finite() {
    let tables = || named_parameters(&model()).into_iter().map(|parameter| parameter.table);
    assert!(all_finite(tables()));
    assert!(all_finite([]));
    for bad in [f64::NAN, f64::INFINITY] {
        let broken = tables().enumerate().map(|(i, table)| if i == 4 { table * bad } else { table });
        assert!(!all_finite(broken));
    }
}

#[test]
fn no_gaussians_are_no_special_case() {
    let none = RowMap { from: Vec::new(), reset: Vec::new() };
    let model = map_parameters(model(), |path, table| match path {
        path if path.starts_with("gaussians.") => none.select(table),
        _ => table,
    });
    assert_eq!(model.gaussians.sh.dims(), [0, 4, 3]);
    assert_eq!(model.gaussians.opacity_logits.dims(), [0]);
    assert_eq!(named_parameters(&model)[4].table.dims(), [0, 12]);
    assert_eq!(parameter_bytes(&model), 8 * 12);
}
