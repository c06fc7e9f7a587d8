//! Bodies as a module against their poses on the host, and their gradients.

use burn::module::{Module, Param, ParamId};
use gs_burn::glam::{DQuat, DVec3};
use gs_burn::map_parameters;
use gs_models::sparsedyn::bodies::law::NUMBERS;
use gs_models::sparsedyn::bodies::{Bodies, Body, BodyFrame, Law, LawValues, NodeFrame, Span};
use gs_tests::devices::{Place, everywhere, reference};
use gs_tests::finite_differences::assert_derivatives;
use gs_tests::scenes::Random;
use gs_tests::tolerance::{assert_near, values};

const SPAN: Span = Span { times: [0.1, 0.85], knots: 6, length: 0.7 };

/// How bodies move.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    /// By their laws.
    Lawful,
    /// Freely until 0.5, then by their laws.
    Phased,
    /// By their laws, bent by two nodes that oscillate.
    Bending,
}

/// One body of each law, with numbers in every place: those that a law does not have must not count.
fn bodies(place: &Place, kind: Kind) -> Bodies {
    let mut random = Random::new(4);
    let motion = |random: &mut Random| -> Vec<[f64; 6]> {
        (0..SPAN.columns() + 8).map(|_| random.values(6, -0.3, 0.3).try_into().expect("six")).collect()
    };
    let one = |(index, law): (usize, &Law)| {
        let centre: [f64; 3] = random.values(3, -1.0, 1.0).try_into().expect("three");
        let since = if kind == Kind::Phased { 0.5 } else { SPAN.times[0] };
        let (rhythms, rates) = if kind == Kind::Bending { (2, vec![4.0, 9.0]) } else { (0, Vec::new()) };
        // Every second one is periodic, and its second number then no rate.
        let multiples = if kind == Kind::Bending && index % 2 == 1 { vec![1, 2] } else { Vec::new() };
        let mut node = |shift: f64| {
            let frame = NodeFrame { centre: centre.map(|x| x + shift), width: 0.4, body: index };
            (frame, motion(&mut random))
        };
        let nodes = if kind == Kind::Bending { vec![node(-0.3), node(0.3)] } else { Vec::new() };
        Body {
            frame: BodyFrame { rhythms, multiples, ..BodyFrame::of(centre, *law, since) },
            values: LawValues(random.values(NUMBERS, -2.0, 2.0).try_into().expect("numbers")),
            free: if kind == Kind::Phased { motion(&mut random) } else { Vec::new() },
            rates,
            nodes,
        }
    };
    let all: Vec<Body> = Law::ALL.iter().enumerate().map(one).collect();
    map_parameters(Bodies::new(&all, SPAN, &place.device), |_, table| table.cast(place.dtype))
}

fn labels(count: usize) -> Vec<u32> {
    (0..count as u32).collect()
}

#[test]
fn gaussians_follow_their_bodies_poses() {
    for place in everywhere() {
        for kind in [Kind::Lawful, Kind::Phased] {
            let bodies = bodies(place, kind);
            let count = bodies.len();
            let positions = place.tensor(&Random::new(6).values(3 * count, -1.0, 1.0), [count, 3]);
            let all = bodies.all();
            for body in &all {
                let other = body.values.0.iter().zip(body.frame.law.mask()).any(|(x, on)| on == 0.0 && *x != 0.0);
                assert!(!other, "numbers of terms that the law does not have are zero");
            }
            for time in [0.1, 0.33, 0.85, 1.2] {
                let state = bodies.of(&positions, &labels(count)).state(time);
                let (moved, turns) = (values(&state.positions), values(&state.turns));
                for (index, x) in values(&positions).chunks(3).enumerate() {
                    let (body, pose) = (&all[index], all[index].pose(&SPAN, time));
                    let first = DVec3::from_array(body.frame.centre);
                    let expected = pose.apply(DVec3::from_slice(x), first);
                    let what = format!("{} {kind:?}, {} at {time}", place.name, Law::ALL[index].in_words());
                    let bound = if place.is_double() { 1e-6 } else { 2e-5 };
                    assert_near(&what, &moved[3 * index..3 * index + 3], &expected.to_array(), bound);
                    let q = &turns[4 * index..4 * index + 4];
                    let q = DQuat::from_xyzw(q[1], q[2], q[3], q[0]).normalize();
                    assert!(q.angle_between(pose.rotation) < 1e-3, "{what}: turn");
                    if kind == Kind::Lawful {
                        let law = body.values.pose(first, time - SPAN.times[0]);
                        assert!(law.centre.distance(pose.centre) < 1e-3, "{what}: numbers of other terms count");
                    }
                }
            }
        }
    }
}

/// Where one node alone has weight, Gaussians follow it; between two that move alike, they follow both. A body whose
/// motion is free has not moved in the first frame.
#[test]
fn nodes_bend_their_body() {
    let place = reference();
    let node = |x: f64, turn: f64, width: f64| {
        let even = [0.2, 0.0, 0.0, 0.0, 0.0, turn];
        (NodeFrame { centre: [x, 0.0, 0.0], width, body: 0 }, vec![even])
    };
    let frame = |since: f64| BodyFrame::of([0.0; 3], Law::of(&[]), since);
    let with = |nodes: Vec<_>| {
        let body = Body { nodes, ..Body::of(frame(SPAN.times[1]), LawValues::REST) };
        map_parameters(Bodies::new(&[body], SPAN, &place.device), |_, table| table.cast(place.dtype))
    };
    let positions = place.tensor(&[-1.0, 0.1, 0.0, 1.0, 0.1, 0.3, 0.0, -0.2, 0.0], [3, 3]);
    let apart = with(vec![node(-1.0, 1.0, 0.1), node(1.0, -1.0, 0.1)]);
    let start = apart.of(&positions, &[0; 3]).state(SPAN.times[0]);
    assert_near("at the first frame", &values(&start.positions), &values(&positions), 1e-7);
    let state = values(&apart.of(&positions, &[0; 3]).state(0.6).positions);
    for (index, (x, turn)) in [(-1.0, 0.5), (1.0, -0.5)].into_iter().enumerate() {
        let (own, centre) = (&values(&positions)[3 * index..3 * index + 3], DVec3::new(x, 0.0, 0.0));
        let expected = centre + DVec3::X * 0.1 + DQuat::from_rotation_z(turn) * (DVec3::from_slice(own) - centre);
        assert_near("beside a node", &state[3 * index..3 * index + 3], &expected.to_array(), 1e-6);
    }
    let strain = |bodies: &Bodies, time: f64| values(&bodies.strain(time, 0.1).expect("two nodes").reshape([1, 1]))[0];
    assert!(strain(&apart, SPAN.times[0]) < 1e-9 && strain(&apart, 0.6) > 1.0);
    // A node whose shift is that of the other's rotation is part of one rigid motion.
    let together = with(vec![node(-1.0, 0.0, 0.5), node(1.0, 0.0, 0.5)]);
    assert!(strain(&together, 0.6) < 1e-9);
    let state = values(&together.of(&positions, &[0; 3]).state(0.6).positions);
    let expected: Vec<f64> =
        values(&positions).iter().enumerate().map(|(k, x)| x + if k % 3 == 0 { 0.1 } else { 0.0 }).collect();
    assert_near("one shift", &state, &expected, 1e-6);
}

#[test]
fn gradients_by_every_number_and_positions_are_right() {
    let place = reference();
    for kind in [Kind::Phased, Kind::Bending] {
        let plain = bodies(place, kind).train();
        let count = plain.len();
        let at = Random::new(8).values(3 * count, -1.0, 1.0);
        let pull = |seed, columns| {
            place.tensor(&Random::new(seed).values(columns * count, -1.0, 1.0), [count, columns]).autodiff()
        };
        let pulls = (pull(9, 3), pull(10, 4));
        let numbers = values(&plain.numbers.val());
        let is_bending = kind == Kind::Bending;
        // Weights of nodes get no gradient by positions, so that these are left out where nodes bend.
        let table = if is_bending { &plain.nodes } else { &plain.free };
        let (motions, shape) = (values(&table.val()), table.dims());
        let rates = values(&plain.rates.val());
        let third: &[f64] = if is_bending { &rates } else { &at };
        let arguments: [(&str, &[f64]); 3] =
            [("numbers", &numbers), ("motions", &motions), (if is_bending { "rates" } else { "positions" }, third)];
        assert_derivatives(&format!("{kind:?}"), place, arguments, 120, |[numbers, motions, third]| {
            let param = |values: burn::tensor::Tensor<2>| Param::initialized(ParamId::new(), values);
            let mut bodies = plain.clone();
            bodies.numbers = param(numbers.reshape([count, NUMBERS]));
            let motions = param(motions.reshape(shape));
            let mut positions = place.tensor(&at, [count, 3]).autodiff();
            if is_bending {
                (bodies.nodes, bodies.rates) = (motions, param(third.reshape([count, 4])));
            } else {
                (bodies.free, positions) = (motions, third.reshape([count, 3]));
            }
            let state = bodies.of(&positions, &labels(count)).state(0.6);
            let mut loss = (state.positions * pulls.0.clone()).sum() + (state.turns * pulls.1.clone()).sum();
            for term in [bodies.strain(0.6, 0.1), bodies.unsaid(0.6, 0.1)].into_iter().flatten() {
                loss = loss + term;
            }
            loss
        });
    }
}
