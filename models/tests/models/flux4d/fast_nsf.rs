//! The distance grid and the flow that is fitted to it.

use gs_models::flux4d::fast_nsf::{DistanceGrid, FastNsfConfig, fit_flow};
use gs_tests::devices::singles;
use gs_tests::scenes::Random;

use super::{cloud, distance};

#[test]
fn distances_are_exact_to_a_cell() {
    let target = cloud(40, 4.0, 1);
    let grid = DistanceGrid::new(&target, &cloud(40, 5.0, 2), 0.1, 1 << 20).expect("points");
    assert_eq!(grid.cell(), 0.1);
    for point in cloud(200, 4.0, 3) {
        let expected = target.iter().map(|other| distance(point, *other)).fold(f64::INFINITY, f64::min);
        let (found, _) = grid.sample(point.map(f64::from));
        // Each end is rounded to a cell's centre, off by half a cell's diagonal of 0.173 at most.
        assert!((found - expected).abs() < 0.174, "{found} not {expected}");
    }
    // The mean over many is better by far: roundings have both signs.
    assert!(grid.sample(target[0].map(f64::from)).0 < 0.174);
}

#[test]
fn slopes_are_differences_and_zero_across_the_border() {
    let grid = DistanceGrid::new(&cloud(30, 3.0, 4), &[], 0.2, 1 << 20).expect("points");
    let h = 1e-6;
    for point in cloud(50, 2.8, 5) {
        let at = point.map(f64::from);
        let (_, slope) = grid.sample(at);
        for axis in 0..3 {
            let shifted = |by: f64| {
                let mut at = at;
                at[axis] += by;
                grid.sample(at).0
            };
            // Linear along an axis within a cell: exact but for rounding over h. No point is within h of a cell's face.
            let difference = (shifted(h) - shifted(-h)) / (2.0 * h);
            assert!((slope[axis] - difference).abs() < 1e-7, "{slope:?} {difference}");
        }
    }
    let (inside, slope) = grid.sample([100.0, 0.0, 0.0]);
    assert!(inside.is_finite() && slope[0] == 0.0);
}

#[test]
fn the_grid_is_capped() {
    let points = [[-100.0, -100.0, -3.0], [100.0, 100.0, 3.0]];
    let grid = DistanceGrid::new(&points, &[], 0.1, 100_000).expect("points");
    assert!(grid.cell() > 0.5, "200 m x 200 m x 6 m in 100000 cells have an edge of 1.3 m: {}", grid.cell());
    let far = grid.sample([-100.0, 100.0, 0.0]).0;
    // 200.02 m to either point, each coordinate off by half a cell.
    assert!((far - 200.02).abs() < 2.0 * grid.cell(), "{far}");
}

/// A ground that rests, and the rear and one side of a car that went 0.6 m: its edges alone say how far.
#[test]
fn a_moving_car_is_followed() {
    let mut random = Random::new(6);
    let mut points = |count: usize, low: [f64; 3], high: [f64; 3]| -> Vec<[f32; 3]> {
        (0..count).map(|_| [0, 1, 2].map(|axis| random.uniform(low[axis], high[axis]) as f32)).collect()
    };
    let ground = points(150, [-15.0, -15.0, -0.05], [15.0, 15.0, 0.05]);
    let body = [points(80, [2.0, 3.0, 0.5], [2.0, 5.0, 2.0]), points(160, [2.0, 3.0, 0.5], [6.0, 3.0, 2.0])].concat();
    let shift = [0.6, 0.0, 0.0];
    let moved: Vec<[f32; 3]> = body.iter().map(|p| [0, 1, 2].map(|axis| p[axis] + shift[axis])).collect();
    let (source, target) = ([ground.clone(), body].concat(), [ground, moved].concat());
    let place = &singles()[0];
    let config = FastNsfConfig { iterations: 150, patience: 40, ..FastNsfConfig::default() };
    let fit = fit_flow(&source, &target, &config, &place.device).expect("a flow");
    assert_eq!(fit.flow.len(), 390);
    let epe = |rows: std::ops::Range<usize>, truth: [f32; 3]| {
        rows.clone().map(|row| distance(fit.flow[row], truth)).sum::<f64>() / rows.len() as f64
    };
    let (still, moving) = (epe(0..150, [0.0; 3]), epe(150..390, shift));
    // Without motion the car's error is 0.6; half of it needs the right direction. A cell is 0.1.
    let told = format!("moving {moving}, still {still}, {:?} after {}", fit.distances, fit.iterations);
    assert!(moving < 0.3 && still < 0.3 && fit.distances[1] < fit.distances[0], "{told}");
    println!("{told}");
}

#[test]
fn hostile_sweeps_are_told() {
    let device = &singles()[0].device;
    let config = FastNsfConfig { iterations: 3, ..FastNsfConfig::default() };
    let told = |source: &[[f32; 3]], target: &[[f32; 3]]| {
        fit_flow(source, target, &config, device).map(|fit| fit.flow.len()).map_err(|error| error.to_string())
    };
    assert_eq!(told(&[], &[[0.0; 3]]).unwrap_err(), "the number of points for the flow is 0; 1 or more is expected");
    assert!(told(&[[0.0; 3]], &[]).is_err() && told(&[[f32::NAN; 3]], &[[0.0; 3]]).is_err());
    assert!(told(&[[0.0; 3]], &[[f32::INFINITY, 0.0, 0.0]]).is_err());
    assert_eq!(told(&[[0.0; 3]], &[[1.0; 3]]), Ok(1));
    assert!(fit_flow(&[[0.0; 3]], &[[0.0; 3]], &FastNsfConfig { rate: f64::NAN, ..config }, device).is_err());
}
