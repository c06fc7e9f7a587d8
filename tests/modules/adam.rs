//! `gs_burn::adam`.

use burn::module::{Module, Param};
use burn::tensor::{Tensor, s};
use gs_burn::ops::adam::{AdamConfig, adam_step};
use gs_burn::{Adam, AdamRate, Gaussians, NamedGradients, RenderOptions, RowMap, named_parameters, render};
use gs_tests::devices::reference;
use gs_tests::scenes::{Random, Scene};
use gs_tests::tolerance::values;

use super::gaussians;

#[derive(Module, Debug)]
struct Model {
    gaussians: Gaussians,
    unreached: Param<Tensor<1>>,
}

/// Five Gaussians of SH degree 1 and a number that no loss reaches, outside autodiff.
fn model() -> Model {
    let unreached = Param::from_tensor(Random::new(1).leaf(reference(), [2], -1.0, 1.0).inner());
    Model { gaussians: gaussians(5), unreached }
}

fn gradients(model: &Model) -> NamedGradients {
    let scene = Scene::random(5, 7);
    let camera = scene.camera(reference().tensor(&scene.viewmat, [4, 4]));
    let tracked = model.clone().train();
    let loss = render(&tracked.gaussians, &camera, &RenderOptions::default()).color.square().sum();
    NamedGradients::take(&tracked, &mut loss.backward())
}

fn rate(path: &str) -> Option<AdamRate> {
    let lr = match path {
        "gaussians.means" => 0.1,
        "gaussians.sh" => return Some(AdamRate { first_columns: Some((3, 0.2)), ..AdamRate::new(0.01) }),
        "gaussians.quats" => return None,
        _ => 0.05,
    };
    Some(AdamRate::new(lr))
}

/// Three updates by path equal those of `adam_step` on each tensor alone, to the bit.
#[test]
fn updates_by_path_are_those_of_each_tensor() {
    let (mut module, mut adam) = (model(), Adam::new());
    let plain = model().gaussians;
    let (mut means, mut sh) = (plain.means.val(), plain.sh.val());
    let mut moments = [means.zeros_like(), means.zeros_like()];
    let mut of_sh = [sh.zeros_like(), sh.zeros_like()];
    for step in 1..=3 {
        let taken = gradients(&module);
        let of = |path: &str| taken.get(path).expect("every leaf has one").clone();
        let config = |lr| AdamConfig { lr, beta1: 0.9, beta2: 0.999, eps: 1e-15, step, first_columns: None };
        let [m, v] = moments;
        let (p, m, v) = adam_step(means, of("gaussians.means"), m, v, &config(0.1));
        (means, moments) = (p, [m, v]);
        let [m, v] = of_sh;
        let gradient = of("gaussians.sh").reshape([5, 4, 3]);
        // The base colour has a rate of its own; the moments do not depend on it.
        let (of_base, ..) = adam_step(sh.clone(), gradient.clone(), m.clone(), v.clone(), &config(0.2));
        let (p, m, v) = adam_step(sh, gradient, m, v, &config(0.01));
        let base = s![.., 0..1];
        (sh, of_sh) = (p.slice_assign(base, of_base.slice(base)), [m, v]);
        module = adam.step(module, taken, rate);
    }
    assert_eq!(values(&module.gaussians.means.val()), values(&means));
    assert_eq!(values(&module.gaussians.sh.val()), values(&sh));
    assert_eq!(module.gaussians.sh.dims(), [5, 4, 3]);
    // Without a rate nothing changes and no moments are kept.
    assert_eq!(values(&module.gaussians.quats.val()), values(&plain.quats.val()));
    assert!(!adam.moments.contains_key("gaussians.quats"));
    // A gradient of zero: the moments exist, the parameter stays.
    assert_eq!(values(&module.unreached.val()), values(&model().unreached.val()));
    assert!(adam.moments.contains_key("unreached"));
    assert_eq!(adam.updates, 3);
}

#[test]
fn moments_follow_rows_under_a_path() {
    let (mut module, mut adam) = (model(), Adam::new());
    for _ in 0..2 {
        let taken = gradients(&module);
        module = adam.step(module, taken, rate);
    }
    let before = adam.clone();
    let rows = RowMap { from: vec![4, 0, 0, 2], reset: vec![false, false, true, false] };
    module.gaussians = rows.apply(module.gaussians);
    adam.follow("gaussians", &rows);
    for (path, moments) in &adam.moments {
        for (now, then) in
            [(&moments.first, &before.moments[path].first), (&moments.second, &before.moments[path].second)]
        {
            if path == "unreached" {
                assert_eq!(values(now), values(then));
                continue;
            }
            let columns = now.dims()[1];
            let (now, then) = (values(now), values(then));
            for (row, (from, reset)) in rows.from.iter().zip(&rows.reset).enumerate() {
                let expected: Vec<f64> = then[columns * *from as usize..][..columns].to_vec();
                let expected = if *reset { vec![0.0; columns] } else { expected };
                assert_eq!(now[columns * row..][..columns], expected, "{path}, row {row}");
            }
        }
    }
    // And the next update finds them fitting.
    assert_eq!(named_parameters(&module)[0].shape, [4, 3]);
    let taken = gradients(&module);
    adam.step(module, taken, rate);
}

#[test]
#[should_panic(expected = "shape of the moments of gaussians.means: they did not follow its rows")]
fn moments_left_behind_are_noticed() {
    let (mut module, mut adam) = (model(), Adam::new());
    let taken = gradients(&module);
    module = adam.step(module, taken, rate);
    module.gaussians = RowMap::keep(vec![0, 1]).apply(module.gaussians);
    let taken = gradients(&module);
    adam.step(module, taken, rate);
}

#[test]
fn new_columns_begin_at_zero_and_forgetting_is_beginning() {
    let (module, mut adam) = (model(), Adam::new());
    let taken = gradients(&module);
    adam.step(module, taken, rate);
    let before = adam.moments["gaussians.sh"].first.clone();
    adam.widen("gaussians.sh", 27);
    let after = &adam.moments["gaussians.sh"].first;
    assert_eq!(after.dims(), [5, 27]);
    assert_eq!(values(&after.clone().narrow(1, 0, 12)), values(&before));
    assert_eq!(values(&after.clone().narrow(1, 12, 15)), [0.0; 75]);

    // A name that only begins alike is not under the path.
    adam.forget("gaussians.s");
    assert!(adam.moments.contains_key("gaussians.sh"));
    adam.forget("gaussians.sh");
    assert!(!adam.moments.contains_key("gaussians.sh") && adam.moments.contains_key("gaussians.means"));
    adam.forget("gaussians");
    assert_eq!(adam.moments.keys().collect::<Vec<_>>(), ["unreached"]);
}

/// A parameter's numbers keep their address through a whole step: the graph of the step releases them, and nothing
/// copies them.
#[cfg(feature = "flex")]
#[test]
fn parameters_are_updated_in_place() {
    let device = burn::tensor::Device::flex();
    let numbers: Vec<f32> = (0..3 * 4 * 5).map(|i| i as f32).collect();
    let tensor = Tensor::<3>::from_data(burn::tensor::TensorData::new(numbers, [3, 4, 5]), &device);
    let mut module = Param::from_tensor(tensor);
    let mut adam = Adam::new();
    let address = |module: &Param<Tensor<3>>| {
        // One owner more during this look, so that it sees the numbers and not a copy.
        match module.val().into_dispatch().kind {
            burn::backend::DispatchTensorKind::Flex(tensor) => {
                tensor.as_float().as_slice::<f32>().expect("f32").as_ptr()
            }
            _ => panic!("a tensor of Flex"),
        }
    };
    let before = address(&module);
    for _ in 0..3 {
        let tracked = module.clone().train();
        let mut gradients = tracked.val().square().sum().backward();
        let gradients = NamedGradients::take(&tracked, &mut gradients);
        drop(tracked);
        module = adam.step(module, gradients, |_| Some(AdamRate::new(0.1)));
        assert_eq!(address(&module), before);
    }
}
