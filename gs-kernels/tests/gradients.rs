//! Backward passes against central differences in `f64`, and singles against doubles.

use crate::scenes::{Random, Scene};
use gs_kernels::config::{RasterizeConfig, ShConfig};
use gs_kernels::cpu::rasterize::RasterizeGradients;
use gs_kernels::cpu::{Real, intersect, projection, rasterize, sh, ssim};

/// Step of the central difference. Its error is `h^2 f'''` (about 1e-10 here) plus rounding `1e-16 / h` (1e-10).
const H: f64 = 1e-6;
/// Relative to the largest gradient of the argument; the sum of both errors above with two digits to spare for
/// curvature. Elements whose difference straddles a cut-off are not excused: scenes are seeded so that none does.
const BOUND: f64 = 1e-6;

/// Checks `gradient` of `f` at `at` for every element (or about `samples` of them).
fn check(name: &str, at: &[f64], gradient: &[f64], samples: usize, f: impl Fn(&[f64]) -> f64) {
    assert_eq!(at.len(), gradient.len(), "{name}: gradient has another shape");
    let scale = gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
    assert!(scale > 0.0, "{name}: the gradient is all zero, the test would prove nothing");
    let mut x = at.to_vec();
    for i in (0..at.len()).step_by((at.len() / samples).max(1)) {
        x[i] = at[i] + H;
        let up = f(&x);
        x[i] = at[i] - H;
        let down = f(&x);
        x[i] = at[i];
        let want = (up - down) / (2.0 * H);
        let error = (gradient[i] - want).abs() / scale;
        assert!(error < BOUND, "{name}[{i}]: {} against {want}, relative error {error:.2e}", gradient[i]);
    }
}

fn weigh(values: &[f64], weights: &[f64]) -> f64 {
    values.iter().zip(weights).map(|(a, b)| a * b).sum()
}

#[test]
fn projection_backward() {
    for antialiased in [false, true] {
        let mut scene = Scene::<f64>::random(40, 3);
        scene.config.antialiased = antialiased;
        let weights = Random::new(9).values(40 * 8, -1.0, 1.0);
        let weights: Vec<f64> = weights.iter().enumerate().map(|(i, w)| if i % 8 == 7 { 0.0 } else { *w }).collect();
        let rows = scene.project();
        assert!(rows.chunks(8).filter(|r| r[7] > 0.0).count() > 30, "most Gaussians should be visible");
        let g = projection::backward(
            &scene.means,
            &scene.quats,
            &scene.log_scales,
            &scene.viewmat,
            &scene.config,
            &rows,
            &weights,
        );
        let run = |m: &[f64], q: &[f64], s: &[f64], v: &[f64]| {
            weigh(&projection::forward(m, q, s, v, &scene.config), &weights)
        };
        let Scene { means, quats, log_scales, viewmat, .. } = &scene;
        check("means", means, &g.means, 200, |x| run(x, quats, log_scales, viewmat));
        check("quats", quats, &g.quats, 200, |x| run(means, x, log_scales, viewmat));
        check("log_scales", log_scales, &g.log_scales, 200, |x| run(means, quats, x, viewmat));
        check("viewmat", &viewmat[..12], &g.viewmat[..12], 12, |x| {
            run(means, quats, log_scales, &[x, &viewmat[12..]].concat())
        });
    }
}

#[test]
fn projection_backward_beyond_the_frustum_margin() {
    let mut scene = Scene::<f64>::random(30, 4);
    for mean in scene.means.chunks_mut(3) {
        mean[0] = mean[0].signum() * (2.5 + mean[0].abs());
        mean[2] = 1.5;
    }
    scene.log_scales.iter_mut().for_each(|s| *s += 2.5);
    let rows = scene.project();
    assert!(rows.chunks(8).filter(|r| r[7] > 0.0).count() > 10, "some must reach into the image");
    let weights: Vec<f64> = (0..rows.len()).map(|i| if i % 8 == 7 { 0.0 } else { 1.0 / (1.0 + i as f64) }).collect();
    let g = projection::backward(
        &scene.means,
        &scene.quats,
        &scene.log_scales,
        &scene.viewmat,
        &scene.config,
        &rows,
        &weights,
    );
    let Scene { means, quats, log_scales, viewmat, config, .. } = &scene;
    let run = |m: &[f64], s: &[f64]| weigh(&projection::forward(m, quats, s, viewmat, config), &weights);
    check("means", means, &g.means, 100, |x| run(x, log_scales));
    check("log_scales", log_scales, &g.log_scales, 100, |x| run(means, x));
}

#[test]
fn sh_backward() {
    for degree in 0..=3_u32 {
        let scene = Scene::<f64>::random(20, 5);
        let config = ShConfig { degree, coefficients: 16 };
        let rows = scene.project();
        let weights = Random::new(10).values(20 * 3, -1.0, 1.0);
        let run = |m: &[f64], c: &[f64], v: &[f64]| weigh(&sh::forward(m, c, v, &rows, &config), &weights);
        let Scene { means, sh: coefficients, viewmat, .. } = &scene;
        let g = sh::backward(means, coefficients, viewmat, &rows, &config, &weights);
        check("sh", coefficients, &g.sh, 300, |x| run(means, x, viewmat));
        if degree > 0 {
            check("means", means, &g.means, 60, |x| run(x, coefficients, viewmat));
            check("viewmat", &viewmat[..12], &g.viewmat[..12], 12, |x| {
                run(means, coefficients, &[x, &viewmat[12..]].concat())
            });
        }
    }
}

#[test]
fn rasterize_backward() {
    for (channels, depth) in [(3, true), (3, false), (1, false), (7, true), (32, false)] {
        let scene = Scene::<f64>::random(60, 6);
        let config = RasterizeConfig { width: scene.config.width, height: scene.config.height, channels, depth };
        let rows = scene.project();
        let mut random = Random::new(11);
        let features = random.values(60 * channels, -0.2, 1.0);
        let background = random.values(channels, 0.0, 1.0);
        let opacities = scene.opacities();
        let lists = intersect::intersect(&rows, &opacities, &features, config.width, config.height, channels);
        let pixels = (config.width * config.height) as usize;
        let weights = random.values(pixels * config.output_channels(), -1.0, 1.0);
        let run = |r: &[f64], o: &[f64], f: &[f64], b: &[f64]| {
            weigh(&rasterize::forward(&config, r, o, f, b, lists.as_slices()), &weights)
        };
        let (image, changed) =
            rasterize::forward_saving(&config, &rows, &opacities, &features, &background, lists.as_slices());
        assert_eq!(image, rasterize::forward(&config, &rows, &opacities, &features, &background, lists.as_slices()));
        let back = |changed: Option<&[i32]>| {
            let lists = lists.as_slices();
            rasterize::backward(&config, &rows, &opacities, &features, &background, lists, &weights, changed)
        };
        let g = back(Some(&changed));
        assert_same(&g, &back(None));
        check("projected", &rows, &g.projected, 480, |x| run(x, &opacities, &features, &background));
        check("opacities", &opacities, &g.opacities, 60, |x| run(&rows, x, &features, &background));
        check("features", &features, &g.features, 200, |x| run(&rows, &opacities, x, &background));
        check("background", &background, &g.background, 32, |x| run(&rows, &opacities, &features, x));
        for (row, screen) in g.projected.chunks(8).zip(g.screen.chunks(4)) {
            assert_eq!(row[..2], screen[..2], "the signed screen gradient is the gradient by the mean");
            // Up to rounding, since the two are not summed by the same formula.
            for k in 0..2 {
                assert!(screen[2 + k] >= screen[k].abs() * (1.0 - 1e-9), "absolute sums are the larger");
            }
        }
    }
}

#[test]
fn ssim_backward() {
    let (width, height, channels) = (23, 19, 3);
    let mut random = Random::new(12);
    let image = random.values(width * height * channels, 0.0, 1.0);
    let target: Vec<f64> = image.iter().map(|x| 0.3 + 0.5 * x * x).collect();
    let (v_l1, v_ssim) = (0.7, -0.4);
    let f = ssim::forward(&image, &target, width, height, channels);
    let g = ssim::backward(&image, &target, &f.saved, width, height, channels, v_l1, v_ssim);
    check("image", &image, &g, 200, |x| {
        let f = ssim::forward(x, &target, width, height, channels);
        v_l1 * f.l1 + v_ssim * f.ssim
    });
}

/// The whole chain in `f32` against `f64`: image to 1e-5, gradients to 1e-3 of the largest.
#[test]
fn singles_follow_doubles() {
    let scene = Scene::<f64>::random(300, 7);
    let single = scene.cast::<f32>();
    let (image64, grads64) = scene.render_and_back();
    let (image32, grads32) = single.render_and_back();
    let mut at_cutoff = 0;
    for (i, (a, b)) in image64.iter().zip(&image32).enumerate() {
        let error = (a - f64::from(*b)).abs();
        // A pixel whose alpha is within rounding of 1/255 may go either way; such pixels are counted, and few.
        if error > 1e-5 {
            at_cutoff += 1;
            assert!(error < 2.0 / 255.0, "value {i}: {a} against {b}");
        }
    }
    assert!(at_cutoff * 1000 <= image64.len(), "{at_cutoff} of {} values differ", image64.len());
    for (name, (a, b)) in ["means", "quats", "log_scales", "sh", "opacities"].iter().zip(grads64.iter().zip(&grads32)) {
        let scale = a.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        for (a, b) in a.iter().zip(b) {
            assert!((a - f64::from(*b)).abs() <= 1e-3 * scale, "{name}: {a} against {b}, scale {scale}");
        }
    }
}

/// Equal to the bit.
fn assert_same<F: Real>(a: &RasterizeGradients<F>, b: &RasterizeGradients<F>) {
    for (a, b) in [
        (&a.projected, &b.projected),
        (&a.opacities, &b.opacities),
        (&a.features, &b.features),
        (&a.background, &b.background),
        (&a.screen, &b.screen),
    ] {
        assert!(a == b);
    }
}

/// The state that the forward pass saves spares the backward pass a search and changes no bit, where pixels end too.
#[test]
fn saved_blocks_change_no_bit() {
    for scale in [1.0, 8.0] {
        let scene = Scene::<f32>::cloud(4000, 75, 53, scale);
        let config = RasterizeConfig { width: 75, height: 53, channels: 3, depth: true };
        let (rows, opacities) = (scene.project(), scene.opacities());
        let sh_config = ShConfig { degree: 3, coefficients: 16 };
        let colors = sh::forward(&scene.means, &scene.sh, &scene.viewmat, &rows, &sh_config);
        let lists = intersect::intersect(&rows, &opacities, &colors, 75, 53, 3);
        let (lists, background) = (lists.as_slices(), [0.5; 3]);
        let (image, changed) = rasterize::forward_saving(&config, &rows, &opacities, &colors, &background, lists);
        assert!(changed.contains(&0), "some pairs change nothing");
        assert!(image.chunks(5).any(|pixel| pixel[4] > 0.9998), "some pixels end, at a transmittance of 1e-4");
        let v: Vec<f32> = (0..image.len()).map(|i| ((i * 37) % 101) as f32 / 101.0 - 0.4).collect();
        let back = |changed| rasterize::backward(&config, &rows, &opacities, &colors, &background, lists, &v, changed);
        assert_same(&back(Some(&changed)), &back(None));
    }
}
