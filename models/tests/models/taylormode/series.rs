//! The paths written out as series, against the paths themselves: polynomial, remainder, kinks, and what happens outside the window.

use gs_formats::{Law, Motion, Splats};
use gs_models::taylormode::{Contact, MotionFrame, RemainderFrame, TaylorMotion};
use gs_tests::devices::everywhere;
use gs_tests::scenes::Random;
use gs_tests::tolerance::values;

use crate::{WINDOW, gaussians, randomised};

fn frame() -> MotionFrame {
    MotionFrame {
        contacts: vec![Contact { near: 0.2, far: 0.7 }, Contact { near: -0.1, far: -0.4 }],
        remainder: Some(RemainderFrame { centre: [0.1, 0.0, -0.2], scale: 0.8, order: 3 }),
        ..MotionFrame::new(vec![4, 1, 2], 3, 2, WINDOW)
    }
}

/// Vectors and results are stored as f32: of sums of 13 terms of at most 20 (two windows out, where a line of slope 3 has risen) the
/// rounding is below 2e-5.
#[test]
fn series_are_the_paths_at_any_time() {
    for place in everywhere() {
        let mut random = Random::new(11);
        let at_t0 = gaussians(place, &mut random);
        let motion: TaylorMotion = randomised(frame().init(5, &place.device), 1.0, place, &mut random);
        let paths = motion.paths(&at_t0.means.val());
        let law = Law::Series(paths.series());
        let span = [WINDOW.t0 - WINDOW.half, WINDOW.t0 + WINDOW.half];
        for middle in [WINDOW.t0, WINDOW.t0 + 0.3 * WINDOW.half] {
            let splats = splats_of(&paths.moved(&at_t0, middle));
            let motion = Motion { span, middle, rows: motion.rows.clone(), law: law.clone() };
            motion.check(splats.len()).expect("a whole motion");
            for s in [-2.0, -1.1, -1.0, -0.3, 0.0, 0.45, 0.9, 1.05, 1.2, 1.9] {
                let t = WINDOW.t0 + s * WINDOW.half;
                let (series, exact) = (motion.at(&splats, t), splats_of(&paths.moved(&at_t0, t)));
                for row in 0..6 {
                    for axis in 0..3 {
                        let (a, b) = (series.means[row][axis], exact.means[row][axis]);
                        assert!((a - b).abs() < 2e-5, "{}: row {row} at s = {s}: {a} and {b}", place.name);
                    }
                    let (p, q) = (series.quats[row].map(f64::from), exact.quats[row].map(f64::from));
                    let norm = |q: [f64; 4]| q.iter().map(|x| x * x).sum::<f64>().sqrt();
                    let cosine = p.iter().zip(q).map(|(p, q)| p * q).sum::<f64>() / norm(p) / norm(q);
                    // The turn between them, squared.
                    assert!(1.0 - cosine.abs() < 1e-6, "{}: row {row} at s = {s}: {p:?} and {q:?}", place.name);
                }
            }
            let t = WINDOW.t0 + 0.33 * WINDOW.half;
            let exact = values(&paths.velocity(t));
            for (i, x) in motion.velocities(t).as_flattened().iter().enumerate() {
                assert!((f64::from(*x) - exact[i]).abs() < 1e-3 * (1.0 + exact[i].abs()), "{x} and {}", exact[i]);
            }
        }
    }
}

fn splats_of(gaussians: &gs_burn::Gaussians) -> Splats {
    fn rows<const C: usize>(values: Vec<f64>) -> Vec<[f32; C]> {
        values.chunks_exact(C).map(|row| std::array::from_fn(|i| row[i] as f32)).collect()
    }
    Splats {
        means: rows(values(&gaussians.means.val())),
        quats: rows(values(&gaussians.quats.val())),
        log_scales: rows(values(&gaussians.log_scales.val())),
        opacity_logits: values(&gaussians.opacity_logits.val()).into_iter().map(|x| x as f32).collect(),
        degree: 0,
        sh: rows(values(&gaussians.sh.val())),
        antialiased: None,
    }
}
