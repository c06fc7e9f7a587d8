//! Seeded random scenes.
#![allow(dead_code)] // each test file uses its own part

use gs_kernels::config::{ProjectionConfig, RasterizeConfig, ShConfig};
use gs_kernels::cpu::{Real, intersect, projection, rasterize, sh};

/// SplitMix64: small, and the same everywhere.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }
    pub fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
    pub fn values<F: Real>(&mut self, n: usize, low: f64, high: f64) -> Vec<F> {
        (0..n).map(|_| F::of(low + (high - low) * self.unit())).collect()
    }
}

#[derive(Clone)]
pub struct Scene<F> {
    pub means: Vec<F>,
    pub quats: Vec<F>,
    pub log_scales: Vec<F>,
    pub logits: Vec<F>,
    pub sh: Vec<F>,
    pub viewmat: Vec<F>,
    pub config: ProjectionConfig,
}

impl<F: Real> Scene<F> {
    /// `n` Gaussians in front of a tilted camera of 53 x 37 pixels (no multiple of a tile).
    pub fn random(n: usize, seed: u64) -> Self {
        let mut r = Random::new(seed);
        let mut means = Vec::new();
        for _ in 0..n {
            let z = 1.5 + 4.0 * r.unit();
            means.extend([F::of(z * (r.unit() - 0.5)), F::of(z * 0.7 * (r.unit() - 0.5)), F::of(z)]);
        }
        let (s, c) = 0.2_f64.sin_cos();
        let viewmat = [c, 0., s, 0.1, 0., 1., 0., -0.05, -s, 0., c, 0.2, 0., 0., 0., 1.].map(F::of).to_vec();
        let config =
            ProjectionConfig { width: 53, height: 37, fx: 45.0, fy: 47.0, cx: 25.3, cy: 19.1, ..Default::default() };
        Self {
            means,
            quats: r.values(4 * n, -1.0, 1.0),
            log_scales: r.values(3 * n, -4.0, -1.0),
            logits: r.values(n, -2.0, 3.0),
            sh: r.values(48 * n, -0.4, 0.4),
            viewmat,
            config,
        }
    }

    /// The same scene in another precision.
    pub fn cast<G: Real>(&self) -> Scene<G> {
        let f = |v: &[F]| v.iter().map(|x| G::of(x.to_f64())).collect();
        Scene {
            means: f(&self.means),
            quats: f(&self.quats),
            log_scales: f(&self.log_scales),
            logits: f(&self.logits),
            sh: f(&self.sh),
            viewmat: f(&self.viewmat),
            config: self.config,
        }
    }

    pub fn count(&self) -> usize {
        self.logits.len()
    }

    pub fn opacities(&self) -> Vec<F> {
        self.logits.iter().map(|&x| F::ONE / (F::ONE + (-x).exp())).collect()
    }

    pub fn project(&self) -> Vec<F> {
        projection::forward(&self.means, &self.quats, &self.log_scales, &self.viewmat, &self.config)
    }

    /// The image (colour, depth, alpha) over a grey background, and the gradients of a fixed weighting of it by means,
    /// quats, log_scales, sh and opacities.
    pub fn render_and_back(&self) -> (Vec<F>, [Vec<F>; 5]) {
        let sh_config = ShConfig { degree: 3, coefficients: 16 };
        let config = RasterizeConfig { width: self.config.width, height: self.config.height, channels: 3, depth: true };
        let rows = self.project();
        let colors = sh::forward(&self.means, &self.sh, &self.viewmat, &rows, &sh_config);
        let opacities = self.opacities();
        let lists = intersect::intersect(&rows, &opacities, &colors, config.width, config.height, 3);
        let background = [F::of(0.5); 3];
        let lists = lists.as_slices();
        let image = rasterize::forward(&config, &rows, &opacities, &colors, &background, lists);
        let v: Vec<F> = (0..image.len()).map(|i| F::of(((i * 37) % 101) as f64 / 101.0 - 0.4)).collect();
        let r = rasterize::backward(&config, &rows, &opacities, &colors, &background, lists, &v, None);
        let s = sh::backward(&self.means, &self.sh, &self.viewmat, &rows, &sh_config, &r.features);
        let p = projection::backward(
            &self.means,
            &self.quats,
            &self.log_scales,
            &self.viewmat,
            &self.config,
            &rows,
            &r.projected,
        );
        let means = p.means.iter().zip(&s.means).map(|(a, b)| *a + *b).collect();
        (image, [means, p.quats, p.log_scales, s.sh, r.opacities])
    }
}

impl Scene<f32> {
    /// A cloud that fills the view of a `width` x `height` camera: depths 2 to 10, footprints of a few pixels (times
    /// `scale`), a mixture of faint and opaque as a trained scene has.
    pub fn cloud(n: usize, width: u32, height: u32, scale: f64) -> Self {
        let mut r = Random::new(42);
        let f = 0.9 * f64::from(width);
        let (w, h) = (f64::from(width), f64::from(height));
        let (mut means, mut log_scales) = (Vec::new(), Vec::new());
        for _ in 0..n {
            let z = 2.0 + 8.0 * r.unit();
            means.extend([z * (r.unit() - 0.5) * w / f, z * (r.unit() - 0.5) * h / f, z].map(|x| x as f32));
            let pixels = scale * 0.7 * (2.0 * r.unit()).exp();
            log_scales.extend([(); 3].map(|()| (pixels * z / f * (1.5 * (r.unit() - 0.5)).exp()).ln() as f32));
        }
        let mut viewmat = vec![0.0; 16];
        (0..4).for_each(|i| viewmat[5 * i] = 1.0);
        let config = ProjectionConfig { width, height, fx: f, fy: f, cx: w / 2.0, cy: h / 2.0, ..Default::default() };
        Self {
            means,
            quats: r.values(4 * n, -1.0, 1.0),
            log_scales,
            logits: r.values(n, -3.0, 3.0),
            sh: r.values(48 * n, -0.2, 0.2),
            viewmat,
            config,
        }
    }
}
