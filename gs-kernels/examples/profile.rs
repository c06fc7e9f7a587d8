//! Processor time of each kernel on one workload, for finding where it goes: `profile [gaussians] [width] [height] [scale]
//! [morton]`. With 1 for `morton`, neighbours in space are neighbours in memory.

#[path = "../tests/scenes/mod.rs"]
mod scenes;

#[path = "../tests/scenes/clock.rs"]
mod clock;

use clock::cpu_seconds;
use gs_kernels::config::{AdamConfig, RasterizeConfig, ShConfig};
use gs_kernels::cpu::{adam, intersect, projection, rasterize, sh, ssim};

fn main() {
    let arg = |i: usize, default: f64| std::env::args().nth(i).map_or(default, |a| a.parse().expect("a number"));
    let (n, w, h) = (arg(1, 1e5) as usize, arg(2, 640.0) as u32, arg(3, 480.0) as u32);
    let mut scene = scenes::Scene::<f32>::cloud(n, w, h, arg(4, 1.0));
    if arg(5, 0.0) > 0.0 {
        sort_along_curve(&mut scene);
    }
    let config = RasterizeConfig { width: w, height: h, channels: 3, depth: false };
    let sh_config = ShConfig { degree: 3, coefficients: 16 };
    let target = vec![0.4_f32; (w * h * 3) as usize];
    let opacities = scene.opacities();
    let mut best = [f64::MAX; 9];
    let mut pairs = 0;
    for _ in 0..15 {
        let mut times = Vec::new();
        let mut start = cpu_seconds();
        let mut lap = || {
            let now = cpu_seconds();
            times.push(now - std::mem::replace(&mut start, now));
        };
        let rows = scene.project();
        lap();
        let colors = sh::forward(&scene.means, &scene.sh, &scene.viewmat, &rows, &sh_config);
        lap();
        let lists = intersect::intersect(&rows, &opacities, &colors, w, h, 3);
        lap();
        let lists = lists.as_slices();
        let (image, changed) = rasterize::forward_saving(&config, &rows, &opacities, &colors, &[0.0; 3], lists);
        lap();
        let rgb: Vec<f32> = image.chunks(4).flat_map(|p| p[..3].to_vec()).collect();
        let l = {
            let start = cpu_seconds();
            let f = ssim::forward(&rgb, &target, w as usize, h as usize, 3);
            let v = ssim::backward(&rgb, &target, &f.saved, w as usize, h as usize, 3, 0.8, -0.2);
            std::hint::black_box(v);
            cpu_seconds() - start
        };
        let v: Vec<f32> = image.iter().map(|x| (x - 0.4) / (w * h) as f32).collect();
        lap();
        let r = rasterize::backward(&config, &rows, &opacities, &colors, &[0.0; 3], lists, &v, Some(&changed));
        lap();
        let s = sh::backward(&scene.means, &scene.sh, &scene.viewmat, &rows, &sh_config, &r.features);
        lap();
        let p = projection::backward(
            &scene.means,
            &scene.quats,
            &scene.log_scales,
            &scene.viewmat,
            &scene.config,
            &rows,
            &r.projected,
        );
        lap();
        let (mut m, mut v2, mut params) = (s.sh.clone(), s.sh.clone(), scene.sh.clone());
        v2.iter_mut().for_each(|v| *v = v.abs());
        lap();
        adam::step(
            &mut params,
            &s.sh,
            &mut m,
            &mut v2,
            &AdamConfig { lr: 1e-3, beta1: 0.9, beta2: 0.999, eps: 1e-15, step: 3, first_columns: None },
        );
        lap();
        std::hint::black_box((p, params));
        pairs = lists.gaussian_ids.len();
        let kept = [times[0], times[1], times[2], times[3], l, times[5], times[6], times[7], times[9]];
        best.iter_mut().zip(kept).for_each(|(b, t)| *b = b.min(t));
    }
    let names = [
        "project",
        "sh",
        "intersect",
        "rasterize",
        "ssim fwd+bwd",
        "rasterize bwd",
        "sh bwd",
        "project bwd",
        "adam (sh)",
    ];
    println!("{n} Gaussians, {w}x{h}, {pairs} tile pairs, {} threads", rayon::current_num_threads());
    for (name, t) in names.iter().zip(best) {
        println!("{name:>14}  {:8.2} ms  {:6.2} G tile-pairs/s", t * 1e3, pairs as f64 * 256.0 / t / 1e9);
    }
    let step: f64 = (0..names.len())
        .filter(|k| !names[*k].starts_with("ssim") && !names[*k].starts_with("adam"))
        .map(|k| best[k])
        .sum();
    println!("{:>14}  {:8.2} ms without loss and Adam", "sum", step * 1e3);
}

/// Orders the rows along a Morton curve through the cube around the scene.
fn sort_along_curve(scene: &mut scenes::Scene<f32>) {
    const BITS: u32 = 10;
    let low: [f32; 3] = std::array::from_fn(|c| scene.means.chunks(3).map(|m| m[c]).fold(f32::INFINITY, f32::min));
    let high: [f32; 3] = std::array::from_fn(|c| scene.means.chunks(3).map(|m| m[c]).fold(f32::NEG_INFINITY, f32::max));
    let edge = (0..3).map(|c| high[c] - low[c]).fold(f32::MIN_POSITIVE, f32::max);
    let code = |row: usize| -> u64 {
        let cell = |c: usize| ((scene.means[3 * row + c] - low[c]) / edge * ((1 << BITS) - 1) as f32) as u64;
        (0..BITS)
            .flat_map(|bit| (0..3).map(move |c| (bit, c)))
            .map(|(bit, c)| (cell(c) >> bit & 1) << (3 * bit + c as u32))
            .sum()
    };
    let mut order: Vec<usize> = (0..scene.count()).collect();
    order.sort_by_cached_key(|row| code(*row));
    let rows = |table: &[f32], columns: usize| -> Vec<f32> {
        order.iter().flat_map(|row| table[row * columns..][..columns].iter().copied()).collect()
    };
    scene.means = rows(&scene.means, 3);
    scene.quats = rows(&scene.quats, 4);
    scene.log_scales = rows(&scene.log_scales, 3);
    scene.logits = rows(&scene.logits, 1);
    scene.sh = rows(&scene.sh, 48);
}
