//! The state that the rasterizer's forward pass saves for the backward pass.

use crate::scenes::Scene;
use gs_kernels::config::{RasterizeConfig, ShConfig};
use gs_kernels::cpu::rasterize::RasterizeGradients;
use gs_kernels::cpu::{Real, intersect, rasterize, sh};

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
        assert!(image == rasterize::forward(&config, &rows, &opacities, &colors, &background, lists));
        assert!(changed.contains(&0), "some pairs change nothing");
        assert!(image.chunks(5).any(|pixel| pixel[4] > 0.9998), "some pixels end, at a transmittance of 1e-4");
        let v: Vec<f32> = (0..image.len()).map(|i| ((i * 37) % 101) as f32 / 101.0 - 0.4).collect();
        let back = |changed| rasterize::backward(&config, &rows, &opacities, &colors, &background, lists, &v, changed);
        assert_same(&back(Some(&changed)), &back(None));
    }
}
