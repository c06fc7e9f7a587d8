//! Polynomials of the right order through noisy centres.

use glam::DVec3;
use gs_multiview::{Centre, Trajectory};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn centres(count: usize, noise: f64, path: impl Fn(f64) -> DVec3) -> Vec<Centre> {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    // A sum of 12 uniform numbers is near enough to normal.
    let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
    (0..count)
        .map(|i| {
            let t = 10.0 + 3.0 * i as f64 / (count - 1) as f64;
            let off = noise * DVec3::new(normal(), normal(), normal());
            Centre { t, position: path(t) + off, residual_px: 0.2, cameras: 9 }
        })
        .collect()
}

fn polynomial(order: usize) -> impl Fn(f64) -> DVec3 {
    let all = [
        DVec3::new(4.0, -2.0, 9.0),
        DVec3::new(0.8, -0.5, 0.3),
        DVec3::new(0.2, 0.4, -0.3),
        DVec3::new(-0.3, 0.1, 0.2),
    ];
    move |t| (0..=order).map(|k| all[k] * (t - 11.5).powi(k as i32)).sum()
}

/// Noise of 0.004 against terms of 0.2 and more, without noise, and with two centres of 16 far off.
#[test]
fn the_order_is_the_paths() {
    for order in 0..4 {
        let path = polynomial(order);
        for noise in [0.0, 0.004] {
            let mut data = centres(16, noise, &path);
            for broken in [false, true] {
                if broken {
                    data[5].position.x += 0.8;
                    data[12].position.z -= 0.5;
                }
                let fit = Trajectory::fit(&data, 5, 2).expect("a fit");
                assert_eq!(fit.order(), order, "noise {noise}, broken {broken}");
                assert_eq!(fit.outliers, if broken { 2 } else { 0 });
                for t in [10.0, 11.0, 12.3, 13.0] {
                    assert!(fit.position(t).distance(path(t)) < 4.0 * noise + 1e-9, "{order} {noise}");
                    let h = 1e-5;
                    let slope = (path(t + h) - path(t - h)) / (2.0 * h);
                    assert!(fit.velocity(t).distance(slope) < 10.0 * noise + 1e-6, "{order} {noise}");
                }
            }
        }
    }
}

/// Beyond its times the path goes on straight, without a jump.
#[test]
fn it_does_not_run_away() {
    let fit = Trajectory::fit(&centres(16, 0.0, polynomial(3)), 5, 2).expect("a fit");
    let (end, speed) = (fit.position(13.0), fit.velocity(13.0));
    assert!(fit.position(14.0).distance(end + speed) < 1e-9);
    assert_eq!(fit.velocity(99.0), speed);
    assert!(fit.position(13.0 + 1e-9).distance(end) < 1e-6);
}

#[test]
fn too_little_is_no_path() {
    let data = centres(16, 0.0, polynomial(1));
    assert!(Trajectory::fit(&[], 3, 2).is_none());
    assert!(Trajectory::fit(&data[..1], 3, 2).is_none());
    assert!(Trajectory::fit(&[data[0]; 5], 3, 2).is_none());
    let mut broken = data[..2].to_vec();
    broken[1].position.x = f64::NAN;
    assert!(Trajectory::fit(&broken, 3, 2).is_none());
    // Two centres fix a line but leave nothing to judge it by.
    assert_eq!(Trajectory::fit(&data[..2], 3, 2).expect("a fit").order(), 0);
    assert_eq!(Trajectory::fit(&data[..3], 3, 2).expect("a fit").order(), 1);
    // Repeated times.
    let twice: Vec<Centre> = data.iter().flat_map(|centre| [*centre, *centre]).collect();
    assert_eq!(Trajectory::fit(&twice, 3, 2).expect("a fit").order(), 1);
}

/// Falls, touches the floor from 11.4 to 11.55, comes up again; sideways it only sways.
fn bounce(t: f64) -> DVec3 {
    let share = ((t - 11.4) / 0.15).clamp(0.0, 1.0);
    let back = 0.5 * share * share * 0.15 + (t - 11.55).max(0.0);
    DVec3::new(0.5 * (t - 11.5), 0.1 * (t - 11.5).powi(2), 1.0 - 0.8 * (t - 10.0).powi(2) + 4.5 * back)
}

/// A bounce is found where it is, with its jump, beside noise and two mistakes; the parabola around it keeps its order.
#[test]
fn a_bounce_has_a_kink() {
    for noise in [0.0, 0.004] {
        for broken in [false, true] {
            let mut data = centres(16, noise, bounce);
            if broken {
                data[2].position.x += 0.8;
                data[13].position.z -= 0.7;
            }
            let fit = Trajectory::fit(&data, 6, 2).expect("a fit");
            let [kink] = fit.kinks[..] else { panic!("noise {noise}, broken {broken}: kinks {:?}", fit.kinks) };
            // Frames are 0.2 apart, positions are tried every 0.05.
            assert!((0.5 * (kink.begin + kink.end) - 11.475).abs() < 0.06, "{kink:?}, noise {noise}, broken {broken}");
            assert!(kink.jump.distance(DVec3::new(0.0, 0.0, 4.5)) < 0.3, "{kink:?}, noise {noise}, broken {broken}");
            assert_eq!(fit.outliers, if broken { 2 } else { 0 }, "noise {noise}");
            // Without noise, higher orders are worth the hundredth of a contact by which the kink is off.
            assert!(fit.order() == 2 || noise == 0.0, "noise {noise}, broken {broken}: order {}", fit.order());
            for t in [10.0, 10.7, 11.2, 11.8, 12.4, 13.0] {
                assert!(fit.position(t).distance(bounce(t)) < 0.03 + 4.0 * noise, "{t}: {}", fit.position(t));
                let slope = (bounce(t + 1e-5) - bounce(t - 1e-5)) / 2e-5;
                assert!(fit.velocity(t).distance(slope) < 0.15, "{t}: {} {slope}", fit.velocity(t));
            }
        }
    }
}

/// Smooth paths, noise alone and few centres have none.
#[test]
fn nothing_else_has_a_kink() {
    for noise in [0.0, 0.004, 0.1] {
        for order in 0..4 {
            let fit = Trajectory::fit(&centres(16, noise, polynomial(order)), 6, 2).expect("a fit");
            assert!(fit.kinks.is_empty(), "order {order}, noise {noise}: {:?}", fit.kinks);
        }
        let sway = |t: f64| DVec3::new((0.9 * t).sin(), (0.9 * t).cos(), 0.0);
        assert!(Trajectory::fit(&centres(16, noise, sway), 6, 2).expect("a fit").kinks.is_empty());
    }
    for count in 2..6 {
        assert!(Trajectory::fit(&centres(count, 0.0, bounce), 6, 2).expect("a fit").kinks.is_empty());
    }
}
