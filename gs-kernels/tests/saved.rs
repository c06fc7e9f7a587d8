//! The state that the rasterizer's forward pass saves for the backward pass.

use crate::scenes::{Random, Scene};
use gs_kernels::config::RasterizeConfig;
use gs_kernels::cpu::rasterize::RasterizeGradients;
use gs_kernels::cpu::{Real, intersect, rasterize};
use gs_kernels::rows::{PROJECTED, SCREEN};

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
fn check<F: Real>(scene: &Scene<F>, channels: usize, depth: bool) {
    let config = RasterizeConfig { width: scene.config.width, height: scene.config.height, channels, depth };
    let (rows, opacities) = (scene.project(), scene.opacities());
    let mut random = Random::new(11);
    let features: Vec<F> = random.values(scene.count() * channels, -0.2, 1.0);
    let background: Vec<F> = random.values(channels, 0.0, 1.0);
    let lists = intersect::intersect(&rows, &opacities, &features, config.width, config.height, channels);
    let lists = lists.as_slices();
    let (image, changed) = rasterize::forward_saving(&config, &rows, &opacities, &features, &background, lists);
    assert!(image == rasterize::forward(&config, &rows, &opacities, &features, &background, lists));
    assert!(changed.contains(&0), "some pairs change nothing");
    let mut alphas = image.chunks(config.output_channels()).map(|pixel| pixel[pixel.len() - 1]);
    assert!(alphas.any(|alpha| alpha > F::of(0.9998)), "some pixels end, at a transmittance of 1e-4");
    let v: Vec<F> = (0..image.len()).map(|i| F::of(((i * 37) % 101) as f64 / 101.0 - 0.4)).collect();
    let back = |changed| rasterize::backward(&config, &rows, &opacities, &features, &background, lists, &v, changed);
    let g = back(Some(&changed));
    assert_same(&g, &back(None));
    for (row, screen) in g.projected.chunks(PROJECTED).zip(g.screen.chunks(SCREEN)) {
        assert!(row[..2] == screen[..2], "the signed half of the screen gradient is the gradient by the mean");
    }
}

#[test]
fn saved_blocks_change_no_bit() {
    for scale in [1.0, 8.0] {
        let scene = Scene::<f32>::cloud(4000, 75, 53, scale);
        for (channels, depth) in [(3, true), (3, false), (1, false), (7, true), (32, false)] {
            check(&scene, channels, depth);
            check(&scene.cast::<f64>(), channels, depth);
        }
    }
}
