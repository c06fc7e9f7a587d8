//! When light is gathered: the exposure's samples (Eq. 7), with a duration that can be learned.

use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, TensorData};

use super::paths::{Instants, Shift};

/// The times of the samples in the exposure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Samples {
    /// From the first moment to the last, Eq. 7: `t_i = (i / (N - 1) - 1/2) tau`. Averaged with equal weights these
    /// spread `sqrt((N + 1) / (N - 1))` times as far as the light did (15 % at N = 7), so an exposure learned with them
    /// comes out shorter than it was unless the weights learn to fall off at both ends.
    Ends,
    /// The middles of N equal parts, `t_i = ((i + 1/2) / N - 1/2) tau`: with equal weights the rule of rectangles, off
    /// by `1 / N^2` only.
    Middles,
}

impl Samples {
    /// `count` offsets from the exposure's centre, in units of its length: -1/2 to 1/2, ascending; one sample is the
    /// centre.
    pub fn offsets(self, count: usize) -> Vec<f64> {
        let one = |i: usize| match self {
            _ if count == 1 => 0.0,
            Self::Ends => i as f64 / (count - 1) as f64 - 0.5,
            Self::Middles => (i as f64 + 0.5) / count as f64 - 0.5,
        };
        (0..count).map(one).collect()
    }

    /// [`offsets`](Self::offsets) of a photo whose shutter was open for a share of the exposure.
    fn shared(self, count: usize, share: f64) -> Vec<f64> {
        self.offsets(count).into_iter().map(|offset| offset * share).collect()
    }

    /// The samples as moments around `t` of an exposure of `tau`, both in the data set's unit of time.
    pub fn instants(self, t: f64, tau: f64, count: usize) -> Instants {
        self.offsets(count).into_iter().map(|offset| t + offset * tau).collect::<Vec<f64>>().into()
    }
}

/// The shutter of a photo.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PhotoShutter {
    /// Which of the learned exposures it has.
    pub exposure: usize,
    /// The share of that exposure for which it was open; 1: all.
    pub share: f64,
}

/// How long shutters are open, learned as logarithms so that they stay positive.
#[derive(Module, Debug)]
pub struct Exposure {
    /// `[C]`, natural logarithms of `tau`, the data set's unit of time: one for all photos, or one a camera.
    pub log_tau: Param<Tensor<1>>,
}

impl Exposure {
    /// `count` exposures of length `tau`, the data set's unit of time.
    ///
    /// # Panics
    /// When `tau` is not positive: such an exposure has no blur to model.
    pub fn new(tau: f64, count: usize, device: &Device) -> Self {
        assert!(tau > 0.0 && tau.is_finite(), "an exposure must be positive, it is {tau}");
        Self { log_tau: Param::from_tensor(Tensor::from_data(TensorData::new(vec![tau.ln(); count], [count]), device)) }
    }

    /// `tau` of one of the exposures, `[1]`.
    pub fn tau(&self, exposure: usize) -> Tensor<1> {
        let all = self.log_tau.val();
        let one = if all.dims() == [1] { all } else { all.narrow(0, exposure, 1) };
        one.exp()
    }

    /// `tau` of all exposures on the host; reads them back from the device.
    pub fn on_host(&self) -> Vec<f64> {
        self.log_tau.to_data().iter::<f64>().map(f64::exp).collect()
    }

    /// Offsets of `count` samples from the exposure's centre, `[count]`, the data set's unit of time. Eq. 7.
    pub fn offsets(&self, samples: Samples, count: usize, shutter: PhotoShutter) -> Tensor<1> {
        let tau = self.tau(shutter.exposure);
        let options = (&tau.device(), tau.dtype());
        tau * Tensor::<1>::from_data(TensorData::new(samples.shared(count, shutter.share), [count]), options)
    }

    /// Moments around `t` at some offsets from an exposure's centre, in units of its length, for models that move
    /// Gaussians to each. When `log_tau` is tracked, they have a [`shift`](Instants::shift), and the exposure is
    /// learned through where the Gaussians are; exact, because the derivative of a position by time is its velocity.
    /// Reads `tau` back from the device.
    pub fn instants(&self, t: f64, offsets: &[f64], PhotoShutter { exposure, share }: PhotoShutter) -> Instants {
        let change = self.log_tau.is_tracked().then(|| self.tau(exposure) - self.tau(exposure).detach());
        let rates: Vec<f64> = offsets.iter().map(|offset| offset * share).collect();
        let tau = self.on_host()[exposure];
        let times = rates.iter().map(|rate| t + rate * tau).collect();
        Instants { times, shift: change.map(|change| Shift { change, rates }) }
    }
}
