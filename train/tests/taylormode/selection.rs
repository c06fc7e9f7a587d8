//! Orders are lowered where nothing shows.

use std::path::PathBuf;

use gs_burn::glam::DMat4;
use gs_datasets::{Intrinsics, Priors, RgbImage8, Truth, View};
use gs_models::Motion;
use gs_models::taylormode::{RemainderNetwork, TimeWindow};
use gs_train::parameters::{Parameters, from_host, to_host};
use gs_train::taylormode::config::MotionConfig;
use gs_train::taylormode::select::{Selected, select};
use gs_train::taylormode::state::{LearnedNetwork, Network, RemainderFrame, still};

use crate::common;

/// A black photo of 1 x 1 pixels by a camera at the origin in which a unit at depth 1 is 100 pixels.
fn black_view() -> View {
    View {
        name: String::new(),
        image_path: PathBuf::new(),
        c2w: DMat4::IDENTITY,
        intrinsics: Intrinsics { fx: 100.0, fy: 100.0, cx: 0.5, cy: 0.5 },
        width: 1,
        height: 1,
        time: Some(0.4),
        camera_id: None,
        image: RgbImage8 { width: 1, height: 1, data: vec![0; 3] },
        mask: None,
        exposure: None,
        priors: Priors::default(),
        truth: Truth::default(),
    }
}

#[test]
fn selection_changes_nothing_that_shows() {
    let device = common::device();
    let table = |row: &[f32]| from_host(row.repeat(6), row.len(), &device);
    let mut parameters = Parameters::new([
        table(&[0.0, 0.0, 1.0]),
        table(&[1.0, 0.0, 0.0, 0.0]),
        table(&[-2.0; 3]),
        table(&[0.0]),
        table(&[0.5; 3]),
    ]);
    // Gaussian 1 stands still but for 0.05 pixels, 2 needs order 2, 4 turns on its place.
    let mut state = still(vec![1, 2, 4], TimeWindow { t0: 0.4, half: 0.25 }, [3, 2], 0.1, &device);
    #[rustfmt::skip]
    let paths = vec![
        0.0005, 0.0, 0.0,  0.0, 0.0, 0.0,  0.0, 0.0, 0.0,
        0.5, 0.0, 0.0,     0.0, 0.3, 0.0,  0.0, 0.0, 0.0005,
        0.0, 0.0, 0.0,     0.0, 0.0, 0.0,  0.0, 0.0, 0.0,
    ];
    state.position.value = from_host(paths, 9, &device);
    let turns = [[0.0; 6], [0.0; 6], [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]];
    state.rotation.value = from_host(turns.as_flattened().to_vec(), 6, &device);
    let times = [0.15, 0.25, 0.4, 0.5, 0.65];
    let before = times.map(|t| state.scene(parameters.gaussians()).at(t));

    let config = MotionConfig { shrink_pixels: 0.0, ..MotionConfig::default() };
    // What a remainder network moves needs no order to do so; one that says nothing keeps no Gaussian moving.
    let stopped = |shift: f32| {
        let mut carried = state.clone();
        carried.remainder = Some(RemainderFrame { centre: [0.0; 3], scale: 1.0, order: 3 });
        let network = RemainderNetwork::new(3, [0.0; 3], 1.0, 1, &device).map(|tensor| tensor + shift);
        carried.networks.push(LearnedNetwork::new(Network::Remainder, &network.mlp));
        select(&mut parameters.clone(), &mut carried, &[black_view()], &config).stopped
    };
    assert_eq!((stopped(0.01), stopped(0.0)), (0, 1));

    let selected = select(&mut parameters, &mut state, &[black_view()], &config);

    assert_eq!(selected, Selected { lowered: 3 + 1 + 3, stopped: 1 });
    assert_eq!((state.rows.as_slice(), state.orders.as_slice()), ([2, 4].as_slice(), [2, 0].as_slice()));
    assert_eq!(state.rotation_orders, [0, 1]);
    let kept = to_host(state.position.value.clone());
    assert!(kept[6..].iter().all(|x| *x == 0.0), "blocks above the orders: {kept:?}");
    let limit = config.select_pixels / 100.0;
    for (t, before) in times.iter().zip(before) {
        let after = state.scene(parameters.gaussians()).at(*t);
        let moved = to_host((before.means.val() - after.means.val()).abs().max());
        assert!(f64::from(moved[0]) <= limit, "{t}: moved by {moved:?}");
        assert_eq!(to_host(before.quats.val()), to_host(after.quats.val()), "{t}");
    }
}
