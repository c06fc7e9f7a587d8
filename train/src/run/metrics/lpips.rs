//! LPIPS (Zhang et al. 2018) by burn-train, in a build with the feature `lpips`.
//!
//! burn-train brings a hundred packages, and its weights are never part of this project; a build without it says that
//! it has none.

#[cfg(feature = "lpips")]
pub use with_burn_train::Perceptual;
#[cfg(not(feature = "lpips"))]
pub use without::Perceptual;

/// How the sentence begins that says why LPIPS is missing.
pub const NO_LPIPS: &str = "no LPIPS";

#[cfg(not(feature = "lpips"))]
mod without {
    use std::convert::Infallible;

    use burn::tensor::{Device, Tensor};

    /// LPIPS, which this build does not have: there is no value of this type.
    #[derive(Debug)]
    pub struct Perceptual {
        /// "vgg", "alex" or "squeeze".
        pub name: &'static str,
        never: Infallible,
    }

    impl Perceptual {
        /// The reason why there is none.
        ///
        /// # Errors
        /// Always, as a sentence.
        pub fn from_cache(_: &Device) -> Result<Self, String> {
            Err(format!("{}: this build is without it (cargo feature lpips)", super::NO_LPIPS))
        }

        /// The distance of two images.
        pub fn distance(&self, _: Tensor<3>, _: Tensor<3>) -> f64 {
            match self.never {}
        }
    }
}

#[cfg(feature = "lpips")]
mod with_burn_train {
    use std::path::PathBuf;

    use burn::tensor::{Device, Int, Tensor};
    use burn_train::metric::vision::{Lpips, LpipsConfig, LpipsNet};

    /// Side of the patterns that distinguish networks, pixels: enough for five halvings.
    const PATTERN: usize = 64;

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
            let cached = |name: &str| {
                ["backbone", "lpips"].iter().all(|part| folder.join(format!("{name}_{part}.pth")).is_file())
            };
            match choices.into_iter().find(|(_, name)| cached(name)) {
                Some((net, name)) => {
                    let read = || Self { network: LpipsConfig::new().with_net(net).init_pretrained(device), name };
                    // Burn continues with random weights if it cannot read the files; those differ between two reads.
                    // The first network is dropped before the second is read, because they are large.
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
}
