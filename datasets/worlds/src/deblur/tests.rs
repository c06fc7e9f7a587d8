//! Tests of internals: derivatives, distances, and whether moving objects stay in view.

use glam::DVec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::write::{cameras, scene};
use super::{DeblurOptions, World};
use crate::tracer::scene::{Lit, Scene};

fn rig(cameras: usize, held_out: usize, width: usize, height: usize) -> DeblurOptions {
    DeblurOptions { cameras, held_out, width, height, ..DeblurOptions::default() }
}

fn stage(world: World, speed: f64) -> Scene {
    scene(world, speed, false, &mut ChaCha8Rng::seed_from_u64(3))
}

/// A ray is traced to a surface point of the moving object; the point is carried along by the pose at other times. Its
/// central difference over 2e-5 must be the analytic velocity. The truncation error is h^2 / 6 times the third
/// derivative (below 100 here), that is 2e-9, and the rounding error 1e-16 / 1e-5; the bounce's force jumps by 2 x 3.1
/// / 0.05 = 125, which a difference across the jump shows as at most 125 h / 2 = 6e-4.
#[test]
fn velocity_is_the_derivative_of_traced_surface_points() {
    let h = 1e-5;
    for (world, speed) in World::ALL.into_iter().flat_map(|world| [1.0, -2.5].map(|speed| (world, speed))) {
        let stage = stage(world, speed);
        for (index, object) in stage.moving.iter().enumerate() {
            let mut seen = 0;
            let mut rng = ChaCha8Rng::seed_from_u64(0);
            let cameras = cameras(&rig(3, 0, 64, 48), &mut rng);
            for step in 0..23 {
                let t = 0.5 + (step as f64 - 11.0) / 25.0;
                let placed = stage.placed(t);
                let pose = placed[index].pose;
                let camera = &cameras[step % 3];
                let (u, v, _) = camera.project(pose.position + DVec3::new(0.1, 0.05, 0.12));
                let ray = camera.ray(u, v);
                let sample = stage.sample(&ray, &stage.still(&ray, Lit::ALL), &placed).body;
                let Some((_, distance)) = sample.filter(|(met, _)| *met == index) else {
                    continue;
                };
                let position = ray.at(distance);
                let solid = pose.rotation.conjugate() * (position - pose.position);
                let at = |t: f64| {
                    let pose = object.motion.pose(t);
                    pose.position + pose.rotation * solid
                };
                let difference = (at(t + h) - at(t - h)) / (2.0 * h);
                let velocity = object.motion.twist(t).at(position, &pose);
                let error = (difference - velocity).length();
                assert!(error < 1e-3 * speed * speed, "{world} at {t}: {velocity} against {difference}");
                seen += 1;
            }
            assert!(seen >= 12, "{world}: only {seen} of 23 rays met {}", object.name);
        }
    }
}

/// A march must end on the form and never inside it: the distance of hits is checked against a dense walk along the
/// ray.
#[test]
fn marched_forms_are_met_where_a_dense_walk_meets_them() {
    for world in [World::Lychee, World::Monkey] {
        let stage = stage(world, 1.0);
        let camera = &cameras(&rig(1, 0, 48, 36), &mut ChaCha8Rng::seed_from_u64(1))[0];
        let pose = stage.placed(0.5)[0].pose;
        let (mut met, mut differ) = (0, 0);
        for i in 0..48 * 36 {
            let ray = camera.ray((i % 48) as f64 + 0.5, (i / 48) as f64 + 0.5);
            let hit = stage.moving[0].solid.intersect(&ray, &pose).map(|hit| hit.t);
            let walked = stage.moving[0].solid.walk(&ray, &pose, 2.0, 6.0, 2e-3);
            match (hit, walked) {
                (Some(hit), Some(walked)) => {
                    met += 1;
                    // The walk overshoots by up to a step; on grazing rays either may slip past an edge.
                    differ += usize::from((walked - hit) < -1e-5 || walked - hit > 2.1e-3);
                }
                (None, None) => {}
                _ => differ += 1,
            }
        }
        assert!(met > 60 && differ * 50 <= met, "{world}: {differ} of {met} rays differ");
    }
}

/// Blur must be there to be removed, and not so long that nothing could: in the middle frames of a world the fastest
/// tenth of what is seen of the moving object moves by 5 to 20 pixels per exposure.
#[test]
fn blur_is_visible_and_bounded() {
    let options = DeblurOptions::default();
    let tau = options.exposure_time();
    for world in World::ALL {
        let stage = stage(world, 1.0);
        let cameras = cameras(&rig(10, 1, options.width, options.height), &mut ChaCha8Rng::seed_from_u64(0));
        let mut lengths = Vec::new();
        for (frame, camera) in [4, 7, 10, 13].into_iter().zip(&cameras) {
            let t = options.time(frame);
            let placed = stage.placed(t);
            for i in 0..64 * 48 {
                let ray = camera.ray((i % 64) as f64 * 4.0 + 2.0, (i / 64) as f64 * 4.0 + 2.0);
                let Some((index, distance)) = stage.sample(&ray, &stage.still(&ray, Lit::ALL), &placed).body else {
                    continue;
                };
                let position = ray.at(distance);
                let way = 0.5 * tau * stage.moving[index].motion.twist(t).at(position, &placed[index].pose);
                let ((u0, v0, _), (u1, v1, _)) = (camera.project(position - way), camera.project(position + way));
                lengths.push((u1 - u0).hypot(v1 - v0));
            }
        }
        lengths.sort_by(f64::total_cmp);
        let (median, fast) = (lengths[lengths.len() / 2], lengths[lengths.len() * 9 / 10]);
        println!("{world}: median {median:.1}, fastest tenth {fast:.1} pixels, {} rays", lengths.len());
        assert!((5.0..20.0).contains(&fast) && median > 3.0, "{world}: median {median:.1}, fastest tenth {fast:.1}");
    }
}

/// The default sequence must be in all views from beginning to end, exposures included.
#[test]
fn movers_stay_in_view_and_in_the_room() {
    let options = DeblurOptions::default();
    for world in World::ALL {
        let stage = stage(world, 1.0);
        let cameras =
            cameras(&rig(options.cameras, 1, options.width, options.height), &mut ChaCha8Rng::seed_from_u64(0));
        for (step, object) in (-1..=33).flat_map(|step| stage.moving.iter().map(move |object| (step, object))) {
            let pose = object.motion.pose(step as f64 / 32.0);
            for camera in &cameras {
                let (u, v, z) = camera.project(pose.position);
                // The outline of a ball is a little larger than its radius in pixels; 5 % cover it at this distance.
                let reach = 1.05 * camera.focal * object.solid.radius / z;
                let inside = u - reach > 0.0 && u + reach < 256.0 && v - reach > 0.0 && v + reach < 192.0;
                assert!(inside, "{world} at step {step}: {u:.0}, {v:.0} with radius {reach:.0} in {}", camera.id);
            }
            let lowest = object.solid.lowest(&pose);
            assert!(lowest > -1e-6, "{world} at step {step} is {lowest} in the floor");
            for (still, solid) in &stage.still {
                let gap = still.pose.position.distance(pose.position) - solid.radius - object.solid.radius;
                assert!(gap > -0.25, "{world} at step {step}: balls around bodies overlap by {gap}");
            }
            for other in stage.moving.iter().filter(|other| other.name != object.name) {
                let gap = other.motion.pose(step as f64 / 32.0).position.distance(pose.position);
                assert!(gap > other.solid.radius + object.solid.radius, "{world} at step {step}: objects meet");
            }
        }
    }
}
