//! Counting numbers.

use gs_models::taylormode::{FixedOrder, Size, Summary};

#[test]
fn numbers_are_counted_by_hand() {
    let size = Size {
        gaussians: 10,
        sh_coefficients: 7 + 3 * 4,
        position_orders: vec![1, 3, 0],
        rotation_orders: vec![0, 1, 1],
        network: 5,
    };
    let fixed = FixedOrder { gaussians: 10, sh_coefficients: 4, position: 3, rotation: 1 };
    let summary = Summary::new(&size, &fixed);
    assert_eq!(summary.count, 10);
    assert_eq!(summary.static_share, 0.7);
    assert_eq!(summary.mean_order, 0.4);
    assert_eq!(summary.histogram, [8, 1, 0, 1]);
    // 10 (11 + 3), three Gaussians with a band of 3 x 3 more, 6 blocks of 3, the network.
    assert_eq!(summary.parameters, 140 + 27 + 18 + 5);
    assert_eq!(summary.bytes, 4 * (190 + 3));
    assert_eq!(summary.fixed_order_parameters, 10 * (11 + 12 + 9 + 3));
    assert!((summary.saved() - (1.0 - 190.0 / 350.0)).abs() < 1e-12);
    let nothing = Summary::new(&Size::default(), &FixedOrder { gaussians: 0, ..fixed });
    assert_eq!((nothing.count, nothing.parameters, nothing.static_share), (0, 0, 0.0));
}
