//! Bodies as a module against their poses on the host, and their gradients.

use burn::module::{Module, Param, ParamId};
use burn::tensor::{Int, Tensor, TensorData};
use gs_burn::glam::{DQuat, DVec3};
use gs_burn::map_parameters;
use gs_models::sparsedyn::bodies::law::NUMBERS;
use gs_models::sparsedyn::bodies::{Bodies, BodyFrame, Law, LawValues};
use gs_tests::devices::{Place, everywhere, reference};
use gs_tests::finite_differences::assert_derivatives;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_near, values};

const SPAN: [f64; 2] = [0.1, 0.85];

/// One body of each law, with numbers in every place: those that a law does not have must not count.
fn bodies(place: &Place, knots: usize) -> Bodies {
    let mut random = Random::new(4);
    let frames: Vec<BodyFrame> = Law::ALL
        .iter()
        .map(|law| BodyFrame { centre: random.values(3, -1.0, 1.0).try_into().expect("three"), law: *law })
        .collect();
    let all: Vec<LawValues> =
        frames.iter().map(|_| LawValues(random.values(NUMBERS, -2.0, 2.0).try_into().expect("numbers"))).collect();
    let bodies = Bodies::new(frames, &all, SPAN, (0.7, knots), &place.device);
    let mut bodies = map_parameters(bodies, |_, table| table.cast(place.dtype));
    if knots > 0 {
        let corrections = random.values(6 * knots * bodies.len(), -0.3, 0.3);
        bodies.corrections = Param::from_tensor(place.tensor(&corrections, [bodies.len(), 6 * knots]));
    }
    bodies
}

fn labels(place: &Place, count: usize) -> Tensor<1, Int> {
    Tensor::from_data(TensorData::new((0..count as i32).collect::<Vec<_>>(), [count]), &place.device)
}

#[test]
fn gaussians_follow_their_bodies_poses() {
    for place in everywhere() {
        for knots in [0, 7] {
            let bodies = bodies(place, knots);
            let count = bodies.len();
            let positions = place.tensor(&Random::new(6).values(3 * count, -1.0, 1.0), [count, 3]);
            let laws = bodies.values();
            for (law, frame) in laws.iter().zip(&bodies.frames) {
                let other = law.0.iter().zip(frame.law.mask()).any(|(x, on)| on == 0.0 && *x != 0.0);
                assert!(!other, "numbers of terms that the law does not have are zero");
            }
            for time in [0.1, 0.33, 0.85, 1.2] {
                let state = bodies.states(&positions, &labels(place, count), time);
                let (moved, turns) = (values(&state.positions), values(&state.turns));
                let poses = bodies.poses(time);
                for (body, x) in values(&positions).chunks(3).enumerate() {
                    let first = DVec3::from_array(bodies.frames[body].centre);
                    let expected = poses[body].apply(DVec3::from_slice(x), first);
                    let what = format!("{} {knots} knots, {} at {time}", place.name, Law::ALL[body].in_words());
                    let bound = if place.is_double() { 1e-6 } else { 2e-5 };
                    assert_near(&what, &moved[3 * body..3 * body + 3], &expected.to_array(), bound);
                    let q = DQuat::from_xyzw(
                        turns[4 * body + 1],
                        turns[4 * body + 2],
                        turns[4 * body + 3],
                        turns[4 * body],
                    );
                    assert!(q.normalize().angle_between(poses[body].rotation) < 1e-3, "{what}: turn");
                    if knots == 0 {
                        let law = laws[body].pose(first, time - SPAN[0]);
                        assert!(law.centre.distance(poses[body].centre) < 1e-3, "{what}: numbers of other terms count");
                    }
                }
            }
        }
    }
}

#[test]
fn gradients_by_numbers_corrections_and_positions_are_right() {
    let place = reference();
    let knots = 6;
    let plain = bodies(place, knots).train();
    let count = plain.len();
    let at = Random::new(8).values(3 * count, -1.0, 1.0);
    let pull = |seed, columns| {
        place.tensor(&Random::new(seed).values(columns * count, -1.0, 1.0), [count, columns]).autodiff()
    };
    let pulls = (pull(9, 3), pull(10, 4));
    let (numbers, corrections) = (values(&plain.numbers.val()), values(&plain.corrections.val()));
    let arguments: [(&str, &[f64]); 3] = [("positions", &at), ("numbers", &numbers), ("corrections", &corrections)];
    assert_derivatives("bodies", place, arguments, 120, |[positions, numbers, corrections]| {
        let numbers = Param::initialized(ParamId::new(), numbers.reshape([count, NUMBERS]));
        let corrections = Param::initialized(ParamId::new(), corrections.reshape([count, 6 * knots]));
        let state = Bodies { numbers, corrections, ..plain.clone() }.states(
            &positions.reshape([count, 3]),
            &labels(place, count),
            0.6,
        );
        (state.positions * pulls.0.clone()).sum() + (state.turns * pulls.1.clone()).sum()
    });
}
