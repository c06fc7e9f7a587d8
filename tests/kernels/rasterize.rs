//! `gs_burn::ops::rasterize`.

use gs_burn::ops::intersect::intersect;
use gs_burn::ops::rasterize::{RasterizeConfig, rasterize, rasterize_reference};
use gs_kernels::rows::{PROJECTED, ProjectedRow};
use gs_tests::cutoff::{SHARE, SHARE_IN_STACKS, undecided_pixels, without};
use gs_tests::devices::{Place, doubles, everywhere, reference, singles};
use gs_tests::scenes::{Random, Scene};
use gs_tests::tolerance::{FORWARD_F32, FORWARD_F64, assert_image, assert_near, assert_near_scaled, bits, values};

/// The buffers that are blended, on the host.
struct Inputs {
    rows: Vec<f64>,
    opacities: Vec<f64>,
    features: Vec<f64>,
    background: Vec<f64>,
    config: RasterizeConfig,
}

impl Inputs {
    fn random(count: usize, channels: usize, depth: bool, size: [u32; 2], seed: u64) -> Self {
        let scene = Scene::random(count, seed).resized(size[0], size[1]);
        let mut random = Random::new(seed);
        Self {
            rows: scene.reference_rows().into_iter().map(|x| f64::from(x as f32)).collect(),
            opacities: random.values(count, 0.01, 1.0),
            features: random.values(count * channels, 0.0, 1.0),
            background: random.values(channels, 0.0, 1.0),
            config: RasterizeConfig { width: size[0], height: size[1], channels, depth },
        }
    }

    fn size(&self) -> [usize; 2] {
        [self.config.width as usize, self.config.height as usize]
    }

    fn image(&self, place: &Place) -> burn::tensor::Tensor<3> {
        let (count, channels) = (self.opacities.len(), self.config.channels);
        let rows = place.tensor(&self.rows, [count, PROJECTED]);
        let opacities = place.tensor(&self.opacities, [count]);
        let features = place.tensor(&self.features, [count, channels]);
        let [width, height] = self.size();
        let lists = intersect(rows.clone(), opacities.clone(), features.clone(), width, height);
        let background = place.tensor(&self.background, [channels]);
        rasterize(rows, opacities, features, background, None, &lists, &self.config)
    }

    fn reference(&self) -> Vec<f64> {
        let (count, channels, place) = (self.opacities.len(), self.config.channels, reference());
        values(&rasterize_reference(
            place.tensor(&self.rows, [count, PROJECTED]),
            place.tensor(&self.opacities, [count]),
            place.tensor(&self.features, [count, channels]),
            place.tensor(&self.background, [channels]),
            None,
            &self.config,
        ))
    }

    #[track_caller]
    fn assert_follows_the_reference(&self, case: &str, share: f64) {
        let expected = self.reference();
        for place in doubles() {
            let what = format!("{case} on {}", place.name);
            assert_near_scaled(&what, &values(&self.image(place)), &expected, FORWARD_F64);
        }
        let undecided = undecided_pixels(&self.rows, &self.opacities, self.size(), share);
        let expected = without(&expected, &undecided);
        for place in singles() {
            let image = without(&values(&self.image(place)), &undecided);
            let RasterizeConfig { channels, depth, .. } = self.config;
            let (width, depth) = (channels + usize::from(depth) + 1, depth.then_some(channels));
            assert_image(&format!("{case} on {}", place.name), &image, &expected, width, depth, FORWARD_F32);
        }
    }
}

fn disc(mean: [f64; 2], variance: f64, depth: f64) -> [f64; PROJECTED] {
    let conic = [1.0 / variance, 0.0, 1.0 / variance];
    ProjectedRow { mean, conic, depth, compensation: 1.0, radius: 3.33 * variance.sqrt() }.pack()
}

/// 20 x 18 pixels; a red disc at depth 1 before a green one at depth 3, both centred on pixel (8, 8), listed back to
/// front.
fn two_discs(opacities: [f64; 2]) -> Inputs {
    Inputs {
        rows: [disc([8.5, 8.5], 4.0, 3.0), disc([8.5, 8.5], 2.0, 1.0)].concat(),
        opacities: opacities.to_vec(),
        features: vec![0.0, 1.0, 0.0, 1.0, 0.0, 0.0],
        background: vec![0.0, 0.0, 1.0],
        config: RasterizeConfig { width: 20, height: 18, channels: 3, depth: true },
    }
}

fn pixel(image: &[f64], x: usize, y: usize) -> &[f64] {
    &image[5 * (20 * y + x)..][..5]
}

#[test]
fn two_discs_composite() {
    for place in everywhere() {
        let image = values(&two_discs([0.8, 0.5]).image(place));
        // At the centre: half red, then 0.8 of the rest green, what is left blue.
        assert_near(&place.name, pixel(&image, 8, 8), &[0.5, 0.4, 0.1, 0.5 + 0.4 * 3.0, 0.9], FORWARD_F32);
        // Two pixels to the right: exp(-4 / 4) of red's opacity, exp(-4 / 8) of green's.
        let (red, green) = (0.5 * (-1.0_f64).exp(), 0.8 * (-0.5_f64).exp());
        let (behind, left) = ((1.0 - red) * green, (1.0 - red) * (1.0 - green));
        let expected = [red, behind, left, red + 3.0 * behind, 1.0 - left];
        assert_near(&place.name, pixel(&image, 10, 8), &expected, FORWARD_F32);
        assert_near(&place.name, pixel(&image, 8, 6), &expected, FORWARD_F32);
        assert_near(&place.name, pixel(&image, 19, 17), &[0.0, 0.0, 1.0, 0.0, 0.0], 0.0);
    }
}

#[test]
fn thresholds_are_those_of_the_constants() {
    for place in everywhere() {
        let centre = |opacities| pixel(&values(&two_discs(opacities).image(place)), 8, 8).to_vec();
        // Capped at 0.999; the second would leave 1e-6 and is not blended, the pixel keeps 0.001 of background.
        assert_near(&place.name, &centre([1.0, 1.0]), &[0.999, 0.0, 0.001, 0.999, 0.999], FORWARD_F32);
        // 0.999 and 0.89 leave 1.1e-4, just enough.
        let left = 0.001 * 0.11;
        let expected = [0.999, 0.001 * 0.89, left, 0.999 + 0.001 * 0.89 * 3.0, 1.0 - left];
        assert_near(&place.name, &centre([0.89, 1.0]), &expected, FORWARD_F32);
        // Opacities on either side of 1/255.
        assert_near(&place.name, &centre([0.0, 0.0039]), &[0.0, 0.0, 1.0, 0.0, 0.0], 0.0);
        assert_near(&place.name, &centre([0.0, 0.004]), &[0.004, 0.0, 0.996, 0.004, 0.004], FORWARD_F32);
    }
}

#[test]
fn any_number_of_channels_in_one_pass() {
    for (channels, depth) in [(1, false), (3, false), (3, true), (5, true), (8, false), (32, false), (32, true)] {
        Inputs::random(60, channels, depth, [53, 37], 6)
            .assert_follows_the_reference(&format!("{channels} channels"), SHARE);
    }
}

/// Each channel of a wide pass is the channel of a pass of its own, to the bit: nothing but speed depends on the width.
#[test]
fn channels_do_not_touch_each_other() {
    let wide = Inputs::random(40, 8, false, [53, 37], 7);
    for place in singles() {
        let image = bits(&wide.image(place));
        for channel in [0, 3, 7] {
            let column = |values: &[f64]| values.iter().skip(channel).step_by(8).copied().collect::<Vec<_>>();
            let narrow = Inputs {
                rows: wide.rows.clone(),
                opacities: wide.opacities.clone(),
                features: column(&wide.features),
                background: column(&wide.background),
                config: RasterizeConfig { channels: 1, ..wide.config },
            };
            let own = bits(&narrow.image(place));
            let same =
                image.chunks(9).zip(own.chunks(2)).all(|(wide, own)| wide[channel] == own[0] && wide[8] == own[1]);
            assert!(same, "channel {channel} on {}", place.name);
        }
    }
}

#[test]
fn any_size_of_image() {
    for size in [[1, 1], [1, 40], [40, 1], [16, 16], [17, 15], [109, 77], [208, 17], [17, 208]] {
        Inputs::random(50, 3, true, size, 8).assert_follows_the_reference(&format!("{}x{}", size[0], size[1]), SHARE);
    }
}

#[test]
fn deep_stacks() {
    for (count, opacity) in [(30, 0.99), (300, 0.9), (300, 0.05), (300, 0.005), (2, 1.0), (1, 1.0)] {
        let mut inputs = Inputs::random(count, 3, true, [33, 20], 9);
        inputs.opacities = vec![f64::from(opacity as f32); count];
        for (i, row) in inputs.rows.chunks_mut(PROJECTED).enumerate() {
            row.copy_from_slice(&disc([15.3 + i as f64 / 64.0, 9.7], 32.0, 2.0 + i as f64 / 64.0));
        }
        inputs.assert_follows_the_reference(&format!("{count} x {opacity}"), SHARE_IN_STACKS);
    }
}
