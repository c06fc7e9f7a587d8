//! Image quality: PSNR and SSIM by this workspace's kernels, MS-SSIM and LPIPS by burn-train.
//!
//! Images are `[H, W, 3]` and are clamped to 0 to 1 first, as in 3DGS. SSIM is the 11x11 Gaussian-window SSIM with zero padding of
//! 3DGS; MS-SSIM has the five scales of Wang et al. 2003.

use std::path::PathBuf;

use burn::data::dataloader::Progress;
use burn::tensor::{Device, Int, Tensor};
use burn_train::metric::vision::{Lpips, LpipsConfig, LpipsNet, MsSsimInput, MsSsimMetric, MsSsimMetricConfig};
use burn_train::metric::{Metric, MetricMetadata, Numeric};
use gs_burn::ops::ssim::l1_ssim;

/// Peak signal-to-noise ratio in dB, peak 1; 100 for equal images.
pub fn psnr(image: Tensor<3>, truth: Tensor<3>) -> f64 {
    let difference = image - truth;
    let mse: f32 = (difference.clone() * difference).mean().into_scalar();
    psnr_of_mse(f64::from(mse))
}

/// PSNR over the pixels whose mask `[H, W, 1]` is 1.
pub fn psnr_masked(image: Tensor<3>, truth: Tensor<3>, mask: Tensor<3>) -> f64 {
    let difference = (image - truth) * mask.clone();
    let squares: f32 = (difference.clone() * difference).sum().into_scalar();
    let pixels: f32 = mask.sum().into_scalar();
    psnr_of_mse(f64::from(squares) / (3.0 * f64::from(pixels).max(1.0)))
}

/// PSNR in dB of a mean squared error; at most 100, the value for equal images.
pub fn psnr_of_mse(mse: f64) -> f64 {
    -10.0 * mse.max(1e-10).log10()
}

/// The mean squared error of a PSNR in dB.
pub fn mse_of_psnr(psnr: f64) -> f64 {
    10.0_f64.powf(-0.1 * psnr)
}

/// Median (upper of the two middle values); `None` if empty.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Mean structural similarity, -1 to 1.
pub fn ssim(image: Tensor<3>, truth: Tensor<3>) -> f64 {
    let both = l1_ssim(image, truth);
    f64::from(both.narrow(0, 1, 1).into_scalar::<f32>())
}

/// Multi-scale SSIM, 0 to 1; `None` if an image side is under 176 pixels, at which the fifth scale is smaller than the window.
pub fn ms_ssim(image: Tensor<3>, truth: Tensor<3>) -> Option<f64> {
    let [height, width, _] = image.dims();
    if height.min(width) < 176 {
        return None;
    }
    let mut metric = MsSsimMetric::new(MsSsimMetricConfig::new(1.0), &image.device());
    let one = Progress { items_processed: 1, items_total: 1, unit: None };
    let metadata = MetricMetadata { progress: one, iteration: None, lr: None };
    metric.update(&MsSsimInput::new(batch(image), batch(truth)), &metadata).ok()?;
    metric.value().map(|value| value.current())
}

/// Side of the patterns that distinguish networks, pixels: enough for five halvings.
const PATTERN: usize = 64;

/// How the sentence begins that says why LPIPS is missing.
pub const NO_LPIPS: &str = "no LPIPS";

/// LPIPS with pretrained weights, where Burn's cache has them; they are never downloaded by us.
#[derive(Debug)]
pub struct Perceptual {
    network: Lpips,
    /// "vgg", "alex" or "squeeze".
    pub name: &'static str,
}

impl Perceptual {
    /// The first of VGG (what 3DGS reports), AlexNet and SqueezeNet whose weights are in the cache.
    ///
    /// # Errors
    /// The reason why there is none, as a sentence that names the folder.
    pub fn from_cache(device: &Device) -> Result<Self, String> {
        let folder = cache_folder().ok_or("no LPIPS: this system has no cache folder")?;
        let choices = [(LpipsNet::Vgg, "vgg"), (LpipsNet::Alex, "alex"), (LpipsNet::Squeeze, "squeeze")];
        let cached =
            |name: &str| ["backbone", "lpips"].iter().all(|part| folder.join(format!("{name}_{part}.pth")).is_file());
        match choices.into_iter().find(|(_, name)| cached(name)) {
            Some((net, name)) => {
                let read = || Self { network: LpipsConfig::new().with_net(net).init_pretrained(device), name };
                // Burn continues with random weights if it cannot read the files; those differ between two reads. The first network
                // is dropped before the second is read, because they are large.
                let first = read().of_patterns(device);
                let network = read();
                let same = network.of_patterns(device).to_bits() == first.to_bits();
                same.then_some(network).ok_or_else(|| {
                    format!(
                        "no LPIPS: expected the weights of {name}, found files that cannot be read in {}",
                        folder.display()
                    )
                })
            }
            None => Err(format!(
                "no LPIPS: its weights are not in Burn's cache, {} (vgg_backbone.pth and vgg_lpips.pth, or alex_*, squeeze_*)",
                folder.display()
            )),
        }
    }

    /// The distance between two patterns, which differs between any two networks.
    fn of_patterns(&self, device: &Device) -> f64 {
        let count = (PATTERN * PATTERN * 3) as i64;
        let ramp = Tensor::<1, Int>::arange(0..count, device).float() / count as f32;
        let ramp = ramp.reshape([PATTERN, PATTERN, 3]);
        self.distance(ramp.clone(), 1.0 - ramp)
    }

    /// LPIPS distance of images `[H, W, 3]` from 0 to 1; 0 for equal images.
    pub fn distance(&self, image: Tensor<3>, truth: Tensor<3>) -> f64 {
        // burn-train maps 0..1 to -1..1, the range of the network.
        let distance = self.network.forward_no_reduction(batch(image), batch(truth));
        f64::from(distance.mean().into_scalar::<f32>())
    }
}

/// The folder of burn-train's LPIPS weights.
fn cache_folder() -> Option<PathBuf> {
    Some(dirs::cache_dir()?.join("burn-dataset").join("lpips"))
}

/// `[H, W, 3]` -> `[1, 3, H, W]`.
fn batch(image: Tensor<3>) -> Tensor<4> {
    image.permute([2, 0, 1]).unsqueeze()
}
