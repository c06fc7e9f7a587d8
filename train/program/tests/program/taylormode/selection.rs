//! Orders are lowered where nothing shows.

use burn::module::Param;
use burn::tensor::Tensor;
use gs_burn::map_parameters;
use gs_datasets::View;
use gs_models::DynamicScene;
use gs_models::taylormode::{BodyFrame, MotionFrame, RemainderFrame, TaylorMotion, TaylorScene, TimeWindow};
use gs_pipelines::taylormode::config::MotionConfig;
use gs_pipelines::taylormode::select::{Selected, select};
use gs_train::fit::parameters::{from_host, gaussians, to_host};

use crate::common;

/// A black photo of 1 x 1 pixels by a camera at the origin in which a unit at depth 1 is 100 pixels.
fn black_view() -> View {
    let mut view = View { time: Some(0.4), ..View::blank(1, 1) };
    (view.intrinsics.fx, view.intrinsics.fy) = (100.0, 100.0);
    view
}

#[test]
fn selection_changes_nothing_that_shows() {
    let device = common::device();
    let table = |row: &[f32]| from_host(row.repeat(6), row.len(), &device);
    let scene = gaussians([
        table(&[0.0, 0.0, 1.0]),
        table(&[1.0, 0.0, 0.0, 0.0]),
        table(&[-2.0; 3]),
        table(&[0.0]),
        table(&[0.5; 3]),
    ]);
    // Gaussian 1 stands still but for 0.05 pixels, 2 needs order 2, 4 turns on its place.
    let window = TimeWindow { t0: 0.4, half: 0.25 };
    let mut motion = MotionFrame::new(vec![1, 2, 4], 3, 2, window).init(1, &device);
    #[rustfmt::skip]
    let paths = vec![
        0.0005, 0.0, 0.0,  0.0, 0.0, 0.0,  0.0, 0.0, 0.0,
        0.5, 0.0, 0.0,     0.0, 0.3, 0.0,  0.0, 0.0, 0.0005,
        0.0, 0.0, 0.0,     0.0, 0.0, 0.0,  0.0, 0.0, 0.0,
    ];
    motion.position = param(from_host(paths, 9, &device));
    let turns = [[0.0; 6], [0.0; 6], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]];
    motion.rotation = param(from_host(turns.as_flattened().to_vec(), 6, &device));
    let times = [0.15, 0.25, 0.4, 0.5, 0.65];
    let before = times.map(|t| TaylorScene { gaussians: scene.clone(), motion: motion.clone() }.at(t));

    let config = MotionConfig { shrink_pixels: 0.0, ..MotionConfig::default() };
    // What a remainder network moves needs no order to do so; one that says nothing keeps no Gaussian moving.
    let stopped = |shift: f32| {
        let network = RemainderFrame { centre: [0.0; 3], scale: 1.0, order: 3 }.init(1, &device);
        let network = map_parameters(network, |_, tensor| tensor + shift);
        let carried = TaylorMotion { remainder: Some(network), ..motion.clone() };
        select(&scene, &carried, &[black_view()], &config).selected.stopped
    };
    assert_eq!((stopped(0.01), stopped(0.0)), (0, 1));

    let selection = select(&scene, &motion, &[black_view()], &config);

    assert_eq!(selection.selected, Selected { lowered: 3 + 1 + 3, stopped: 1 });
    assert_eq!(selection.kept.expect("one stopped").from, [1, 2]);
    let motion = &selection.motion;
    assert_eq!((motion.rows.as_slice(), motion.orders.as_slice()), ([2, 4].as_slice(), [2, 0].as_slice()));
    assert_eq!(motion.rotation_orders, [0, 1]);
    let kept = to_host(motion.position.val());
    assert!(kept[6..].iter().all(|x| *x == 0.0), "blocks above the orders: {kept:?}");
    let limit = config.select_pixels / 100.0;
    let selected = TaylorScene { gaussians: selection.gaussians, motion: motion.clone() };
    for (t, before) in times.iter().zip(before) {
        let after = selected.at(*t);
        let moved = to_host((before.means.val() - after.means.val()).abs().max());
        assert!(f64::from(moved[0]) <= limit, "{t}: moved by {moved:?}");
        assert_eq!(to_host(before.quats.val()), to_host(after.quats.val()), "{t}");
    }
}

/// A plate that turns and drifts, in front of a wall of which three Gaussians were taken for moving ones: rows that are
/// on the body's path store nothing, one that flutters keeps its own order, and what rests belongs to none.
#[test]
fn rows_keep_what_their_body_does_not_say() {
    const ROWS: usize = 40;
    let device = common::device();
    let grid = |i: usize| [(i % 7) as f32 * 0.1 - 0.3, (i / 7) as f32 * 0.1 - 0.3, 2.0 + 0.02 * (i % 5) as f32];
    let means: Vec<f32> = (0..ROWS).flat_map(grid).collect();
    let row = |values: &[f32]| from_host(values.repeat(ROWS), values.len(), &device);
    let scene = gaussians([
        from_host(means.clone(), 3, &device),
        row(&[1.0, 0.0, 0.0, 0.0]),
        row(&[-4.0; 3]),
        row(&[0.0]),
        row(&[0.5; 3]),
    ]);
    let window = TimeWindow { t0: 0.4, half: 0.25 };
    let mut frame = MotionFrame::new((0..ROWS as u32).collect(), 3, 2, window);
    frame.bodies = vec![BodyFrame { order: 3, ..BodyFrame::new([0.0, 0.0, 2.0], 0.4) }];
    frame.body_of.fill(0);
    let mut motion = frame.init(1, &device);
    let rests = |i: usize| i >= ROWS - 3;
    let path = |i: usize| {
        let [x, y, _] = grid(i);
        let flutter = if i == 5 { 0.4 } else { 0.0 };
        let blocks = [0.3 - 0.5 * y, 0.5 * x, 0.0, -0.1 * x, -0.1 * y + flutter, 0.0, 0.0, 0.0, 0.0];
        blocks.map(|x| if rests(i) { 0.0 } else { x })
    };
    motion.position = param(from_host((0..ROWS).flat_map(path).collect(), 9, &device));
    // As the body turns: by atan(0.5 s / (1 - 0.1 s^2)) about the line of sight, 0.49 s to within 0.02.
    let turns = |i: usize| [0.0, 0.0, if rests(i) { 0.0 } else { 0.49 }, 0.0, 0.0, 0.0];
    motion.rotation = param(from_host((0..ROWS).flat_map(turns).collect(), 6, &device));
    let config = MotionConfig { shrink_pixels: 0.0, ..MotionConfig::default() };
    let before = TaylorScene { gaussians: scene.clone(), motion: motion.clone() };

    let selection = select(&scene, &motion, &[black_view()], &config);

    let motion = &selection.motion;
    assert_eq!(selection.selected.stopped, 3);
    assert_eq!((motion.len(), motion.followers(), motion.orders[5]), (ROWS - 3, ROWS - 4, 2));
    assert!(motion.body_of.iter().all(|body| *body == 0));
    // 4 numbers of the body's place, 12 of each order and 6 of its turn; two orders of one row.
    assert_eq!(motion.numbers(), 4 + 12 * 3 + 6 + 3 * 2);
    let turn = to_host(motion.bodies[0].turn.val());
    assert!(turn[..2].iter().all(|x| x.abs() < 1e-3) && (turn[2] - 0.49).abs() < 0.02, "{turn:?}");
    // What follows goes on to follow.
    let again = select(&selection.gaussians, motion, &[black_view()], &config);
    assert_eq!((again.selected, again.motion.followers()), (Selected::default(), ROWS - 4));
    let after = TaylorScene { gaussians: selection.gaussians, motion: motion.clone() };
    for t in [0.15, 0.3, 0.5, 0.65] {
        let moved = to_host((before.at(t).means.val() - after.at(t).means.val()).abs().max());
        assert!(f64::from(moved[0]) <= config.select_pixels / 50.0, "{t}: moved by {moved:?}");
    }
}

fn param(table: Tensor<2>) -> Param<Tensor<2>> {
    Param::from_tensor(table)
}
