//! Actors of a scene with two moving boxes of points.

use gs_burn::Gaussians;
use gs_models::flux4d::actors::{Actor, ActorConfig, LinkConfig, find_actors, link_actors};
use gs_models::flux4d::{FluxScene, PolynomialMotion};
use gs_tests::devices::{Place, reference};
use gs_tests::scenes::Random;

/// 60 points a box of 1 m, one going along y at 10 m/s, one along -x at 2 m/s, and 100 at rest. Points are where their
/// object was at their own time. The window is one second from 5 s on.
pub(super) fn street(place: &Place) -> FluxScene {
    let mut random = Random::new(3);
    let (mut means, mut velocity, mut times) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..220 {
        let offset = random.values(3, -0.5, 0.5);
        let time = f64::from(i % 6) / 5.0;
        let (centre, speed) = match i {
            0..60 => ([0.0, 0.0, 0.5], [0.0, 10.0, 0.0]),
            60..120 => ([8.0, 3.0, 0.5], [-2.0, 0.0, 0.0]),
            _ => ([4.0, -2.0, 0.5], [0.0; 3]),
        };
        means.extend((0..3).map(|axis| centre[axis] + offset[axis] + time * speed[axis]));
        velocity.extend(speed);
        times.push(time as f32);
    }
    scene(place, &means, &velocity, &times)
}

/// Equal Gaussians with constant velocities, metres per second, in a window of one second from 5 s on.
fn scene(place: &Place, means: &[f64], velocity: &[f64], times: &[f32]) -> FluxScene {
    let count = times.len();
    let full = |value: f64, columns: usize| place.tensor(&vec![value; count * columns], [count, columns]);
    let quats: Vec<f64> = (0..count).flat_map(|_| [1.0, 0.0, 0.0, 0.0]).collect();
    let gaussians = Gaussians::from_tensors(
        place.tensor(means, [count, 3]),
        place.tensor(&quats, [count, 4]),
        full(-3.0, 3),
        full(0.0, 1).reshape([count]),
        full(0.25, 3).reshape([count, 1, 3]),
    );
    let motion = PolynomialMotion::new(0).expect("a degree");
    FluxScene::new(gaussians, place.tensor(velocity, [count, 3]), times, motion, [5.0, 6.0], 0.2).expect("a scene")
}

fn near(a: [f64; 3], b: [f64; 3], bound: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() <= bound)
}

pub(super) fn found(scene: &FluxScene) -> Vec<Actor> {
    // 60 points in a cubic metre have 16 within 0.4 m on average, fewer at corners; 0.6 m leaves none out.
    find_actors(scene, 5.5, &[5.0, 6.0], &ActorConfig { eps: 0.6, min_points: 4, ..ActorConfig::default() })
        .expect("actors")
}

#[test]
fn moving_boxes_are_found_with_box_speed_and_track() {
    let scene = street(reference());
    assert_eq!((scene.moving(), scene.resting()), (120, 100));
    let actors = found(&scene);
    assert_eq!(actors.iter().map(|actor| actor.rows.len()).collect::<Vec<_>>(), [60, 60]);
    let [fast, slow] = [&actors[0], &actors[1]];
    assert!((fast.speed - 10.0).abs() < 1e-9 && (slow.speed - 2.0).abs() < 1e-9);
    // 60 uniform points reach to within 1/60 of each side on average; a tenth is six times that. Means scatter by 0.29
    // / sqrt(60).
    assert!(
        near(fast.bounds.centre, [0.0, 5.0, 0.5], 0.1) && near(fast.bounds.size, [0.95; 3], 0.1),
        "{:?}",
        fast.bounds
    );
    assert!((fast.bounds.yaw - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
    assert!(near(slow.bounds.centre, [7.0, 3.0, 0.5], 0.1), "{:?}", slow.bounds);
    assert_eq!(fast.track.iter().map(|point| point.time).collect::<Vec<_>>(), [5.0, 6.0]);
    assert!(near(fast.track[0].centre, [0.0, 0.0, 0.5], 0.15) && near(fast.track[1].centre, [0.0, 10.0, 0.5], 0.15));
    assert!(near(slow.track[0].velocity, [-2.0, 0.0, 0.0], 1e-9));
    let config = ActorConfig { speed: 5.0, eps: 0.6, min_points: 4 };
    assert_eq!(find_actors(&scene, 5.5, &[], &config).expect("actors").len(), 1);
}

/// Without bringing the points to one time the fast box would be six boxes, 2 m apart.
#[test]
fn a_scene_without_motion_has_no_actors() {
    let place = reference();
    let still = street(place);
    let config = ActorConfig { speed: 100.0, ..ActorConfig::default() };
    assert_eq!(find_actors(&still, 5.5, &[5.0], &config).expect("actors"), []);
    assert!(find_actors(&still, 5.5, &[5.0], &ActorConfig { eps: f64::NAN, ..config }).is_err());
}

#[test]
fn actors_are_linked_where_their_tracks_meet() {
    let actors = found(&street(reference()));
    let later: Vec<Actor> = actors
        .iter()
        .rev()
        .map(|actor| {
            let mut actor = actor.clone();
            // Half a second on, by its own velocity.
            for point in &mut actor.track {
                point.time += 0.5;
                (0..3).for_each(|axis| point.centre[axis] += 0.5 * point.velocity[axis]);
            }
            actor
        })
        .collect();
    let mut stranger = later[0].clone();
    stranger.track.iter_mut().for_each(|point| point.centre[2] += 50.0);
    let snippets = [actors, [later.clone(), vec![stranger]].concat(), Vec::new(), later];
    let tracks = link_actors(&snippets, &LinkConfig::default());
    assert_eq!(tracks.numbers, [vec![0, 1], vec![1, 0, 2], vec![], vec![3, 4]]);
    assert_eq!(tracks.count, 5);
}

/// Two walls of `rows` points each, 1.4 m apart along x, that drive at the given speeds along x.
fn walls(place: &Place, rows: usize, speeds: [f64; 2]) -> FluxScene {
    let count = 2 * rows;
    let (mut means, mut velocity) = (Vec::new(), Vec::new());
    for i in 0..count {
        let wall = i / rows;
        means.extend([1.4 * wall as f64, 0.1 * (i % rows) as f64, 0.5]);
        velocity.extend([speeds[wall], 0.0, 0.0]);
    }
    // All at the middle of the window, at which they are clustered.
    scene(place, &means, &velocity, &vec![0.5; count])
}

/// The bumper of a far car and its window are one actor; bodies of many rows, and those that move otherwise, are not.
#[test]
fn clusters_of_few_rows_that_move_alike_are_one_actor() {
    let actors = |rows, speeds| {
        let config = ActorConfig { eps: 0.3, min_points: 4, ..ActorConfig::default() };
        find_actors(&walls(reference(), rows, speeds), 5.5, &[], &config).expect("actors")
    };
    let one = actors(8, [9.0, 9.5]);
    assert_eq!(one.iter().map(|actor| actor.rows.clone()).collect::<Vec<_>>(), [(0..16).collect::<Vec<u32>>()]);
    assert_eq!(actors(8, [9.0, -9.0]).len(), 2);
    assert_eq!(actors(60, [9.0, 9.5]).len(), 2);
}
