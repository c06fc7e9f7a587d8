//! The learned motion as a module: what a checkpoint holds gives it back to the bit, and rows take their motion along.

use burn::module::Module;
use burn::tensor::Tensor;
use gs_burn::{NamedGradients, RowMap, named_parameters, try_map_parameters};
use gs_models::taylormode::bodies::NO_BODY;
use gs_models::taylormode::{BodyFrame, Contact, MotionFrame, RemainderFrame, TaylorMotion, TimeWindow};
use gs_tests::devices::{Place, everywhere, reference};
use gs_tests::scenes::Random;
use gs_tests::tolerance::values;

use crate::{WINDOW, gaussians, randomised};

/// Rows 4, 1 and 2 of six, with numbers that decimal notation does not hold.
fn frame() -> MotionFrame {
    let third = 1.0 / 3.0;
    MotionFrame {
        window: TimeWindow { t0: WINDOW.t0 + 1e-17, half: third },
        recording: [0.1 + third * 0.1, 0.7],
        contacts: vec![Contact { near: 0.1 * third, far: 0.7 }],
        remainder: Some(RemainderFrame { centre: [third, -third * third, 0.1], scale: 0.3, order: 3 }),
        orders: vec![3, 1, 0],
        rotation_orders: vec![2, 2, 1],
        own_jumps: vec![true, false, true],
        body_of: vec![0, NO_BODY, 0],
        bodies: vec![BodyFrame { order: 2, ..BodyFrame::new([0.1, third, -0.2], 5.0 * third) }],
        ..MotionFrame::new(vec![4, 1, 2], 3, 2, WINDOW)
    }
}

fn motion(place: &Place) -> TaylorMotion {
    randomised(frame().init(5, &place.device), 1.0, place, &mut Random::new(9))
}

#[test]
fn its_parameters_have_paths() {
    let motion = motion(reference());
    let found: Vec<(String, Vec<usize>)> =
        named_parameters(&motion).into_iter().map(|parameter| (parameter.path, parameter.shape)).collect();
    let named = |path: &str, shape: &[usize]| (path.to_string(), shape.to_vec());
    assert_eq!(found[..3], [named("position", &[3, 9]), named("rotation", &[3, 6]), named("kinks.jumps", &[3, 3])]);
    assert_eq!(found[3..5], [named("bodies.0.blocks", &[4, 12]), named("bodies.0.turn", &[1, 6])]);
    assert_eq!(found[5], named("remainder.mlp.layers.0.weight", &[3, 32]));
    assert_eq!(found.len(), 5 + 6);
    assert_eq!(found[..3].iter().map(|(path, _)| path.as_str()).collect::<Vec<_>>(), TaylorMotion::ROW_PARAMETERS);
}

/// Frame as JSON and tensors by path: all that a checkpoint has to hold.
#[test]
fn frame_and_tensors_give_it_back_to_the_bit() {
    for place in everywhere() {
        let motion = motion(place);
        let json = serde_json::to_string(&motion.frame()).expect("JSON");
        let stored = named_parameters(&motion);

        let frame: MotionFrame = serde_json::from_str(&json).expect("the same JSON");
        assert_eq!(frame, motion.frame());
        let empty = frame.init(1, &place.device);
        let back = try_map_parameters(empty, |parameter| {
            let found = stored.iter().find(|stored| stored.path == parameter.path && stored.shape == parameter.shape);
            found.map(|stored| stored.table.clone()).ok_or(parameter.path)
        });
        let back = back.expect("every parameter was stored");
        let still = gaussians(place, &mut Random::new(2));
        for t in [0.1, 0.5, 0.62] {
            let moved = |motion: &TaylorMotion| values(&motion.paths(&still.means.val()).moved(&still, t).means.val());
            assert_eq!(moved(&back), moved(&motion), "{} at {t}", place.name);
        }
    }
}

#[test]
fn it_begins_at_rest() {
    for place in everywhere() {
        let motion = crate::cast(frame().init(5, &place.device), place);
        let still = gaussians(place, &mut Random::new(2));
        let paths = motion.paths(&still.means.val());
        assert_eq!(values(&paths.displacement(0.6)), [0.0; 9], "{}", place.name);
        assert_eq!(values(&paths.velocities(6, 0.6)), [0.0; 18], "{}", place.name);
    }
}

#[test]
fn all_that_is_learned_gets_a_gradient_through_the_paths() {
    let place = reference();
    let tracked = motion(place).train();
    let still = gaussians(place, &mut Random::new(2));
    let moved = tracked.paths(&still.means.val()).moved(&still, 0.65);
    let loss = moved.means.val().powi_scalar(3).sum() + moved.quats.val().powi_scalar(3).sum();
    let gradients = NamedGradients::take(&tracked, &mut loss.backward());
    assert_eq!(gradients.iter().count(), 11);
    for (path, gradient) in gradients.iter() {
        // The step of a body is made of its rows' gradients; see the optimiser.
        let learns = !path.starts_with("bodies");
        assert_eq!(values(gradient).iter().any(|g| *g != 0.0), learns, "{path}");
    }
}

/// Rows 1 and 4 move and are copied, row 2 is removed, row 0 stands.
#[test]
fn motion_follows_its_rows() {
    let place = reference();
    let before = motion(place);
    let scene = RowMap { from: vec![4, 0, 1, 4], reset: vec![false, false, true, true] };
    let (after, own) = before.clone().follow(&scene);
    assert_eq!(after.rows, [0, 2, 3]);
    assert_eq!(own, RowMap { from: vec![0, 1, 0], reset: vec![false, true, true] });
    assert_eq!(
        (after.orders.as_slice(), after.rotation_orders.as_slice()),
        ([3, 1, 3].as_slice(), [2, 2, 2].as_slice())
    );
    assert_eq!(after.own_jumps, [true, false, true]);
    assert_eq!(after.body_of, [0, NO_BODY, 0]);
    for path in TaylorMotion::ROW_PARAMETERS {
        let table = |motion: &TaylorMotion| {
            let found = named_parameters(motion).into_iter().find(|parameter| parameter.path == path);
            let table = found.expect("a parameter").table;
            let columns = table.dims()[1];
            values(&table).chunks(columns).map(<[f64]>::to_vec).collect::<Vec<_>>()
        };
        let (old, new) = (table(&before), table(&after));
        assert_eq!(new, [old[0].clone(), old[1].clone(), old[0].clone()], "{path}");
    }
    // Parameters keep their ids, so an optimiser that knows them by id finds them again.
    assert_eq!(after.position.id, before.position.id);
}

#[test]
fn gaussians_can_stop_moving() {
    let (motion, own) = motion(reference()).retain(&[0, 2]);
    assert_eq!((motion.rows.as_slice(), own.from.as_slice()), ([4, 2].as_slice(), [0, 2].as_slice()));
    assert_eq!(motion.orders, [3, 0]);
    assert_eq!(motion.position.dims(), [2, 9]);
    let (none, _) = motion.retain(&[]);
    assert!(none.is_empty());
    assert_eq!([none.position.dims(), none.rotation.dims()], [[0, 9], [0, 6]]);
    assert_eq!(none.order(), 3);
}

/// A row has blocks of its own up to its order, then those of its body, or zero where it has none.
#[test]
fn blocks_above_the_order_are_those_of_the_body() {
    for place in everywhere() {
        let before = motion(place);
        let means = place.tensor(&(0..18).map(|i| 0.1 * f64::from(i) - 0.8).collect::<Vec<_>>(), [6, 3]);
        let held = before.clone().hold_orders(&means);
        let rows = |tensor: &Tensor<2>| -> Vec<Vec<f64>> {
            let columns = tensor.dims()[1];
            values(tensor).chunks(columns).map(<[f64]>::to_vec).collect()
        };
        let (old, new) = (rows(&before.position.val()), rows(&held.position.val()));
        let body = &before.bodies[0];
        let blocks = rows(&body.blocks.val());
        let carried = |row: usize, columns: std::ops::Range<usize>| -> Vec<f64> {
            let mean: Vec<f32> = (0..3).map(|axis| (0.1 * f64::from((3 * row + axis) as u32) - 0.8) as f32).collect();
            assert!(body.frame.carries(&mean));
            let basis = body.frame.basis_at(&mean);
            columns.map(|column| (0..4).map(|i| basis[i] * blocks[i][column]).sum()).collect()
        };
        let near = |found: &[f64], expected: &[f64]| {
            let close = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5);
            assert!(close && found.len() == expected.len(), "{}: {found:?}, not {expected:?}", place.name);
        };
        near(&new[0], &old[0]);
        near(&new[1], &[&old[1][..3], &[0.0; 6]].concat());
        near(&new[2], &carried(2, 0..9));
        let jumps = |motion: &TaylorMotion| rows(&motion.kinks.as_ref().expect("kinks").jumps.val());
        let (old, new) = (jumps(&before), jumps(&held));
        near(&new[0], &old[0]);
        near(&new[1], &[0.0; 3]);
        near(&new[2], &old[2]);
        let (old, new) = (rows(&before.rotation.val()), rows(&held.rotation.val()));
        near(&new[0], &old[0]);
        near(&new[2], &[&old[2][..3], &rows(&body.turn.val())[0][3..]].concat());
    }
    let full = MotionFrame::new(vec![0, 1], 2, 0, WINDOW).init(0, &reference().device);
    assert!(full.order_masks().iter().all(|(_, mask)| mask.is_none()), "nothing to hold");
}
