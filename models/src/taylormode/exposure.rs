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

/// How long the shutter is open, learned as a logarithm so that it stays positive.
#[derive(Module, Debug)]
pub struct Exposure {
    /// `[1]`, natural logarithm of `tau`, the data set's unit of time.
    pub log_tau: Param<Tensor<1>>,
}

impl Exposure {
    /// An exposure of length `tau`, the data set's unit of time.
    ///
    /// # Panics
    /// When `tau` is not positive: such an exposure has no blur to model.
    pub fn new(tau: f64, device: &Device) -> Self {
        assert!(tau > 0.0 && tau.is_finite(), "an exposure must be positive, it is {tau}");
        Self { log_tau: Param::from_tensor(Tensor::from_data(TensorData::new(vec![tau.ln()], [1]), device)) }
    }

    /// `tau`, `[1]`.
    pub fn tau(&self) -> Tensor<1> {
        self.log_tau.val().exp()
    }

    /// `tau` on the host; reads it back from the device.
    pub fn tau_on_host(&self) -> f64 {
        self.log_tau.to_data().iter::<f64>().next().unwrap_or(f64::NAN).exp()
    }

    /// Offsets of `count` samples from the exposure's centre, `[count]`, the data set's unit of time. Eq. 7. The
    /// photo's shutter was open for the `share` of `tau` (1: all).
    pub fn offsets(&self, samples: Samples, count: usize, share: f64) -> Tensor<1> {
        let tau = self.tau();
        let options = (&tau.device(), tau.dtype());
        tau * Tensor::<1>::from_data(TensorData::new(samples.shared(count, share), [count]), options)
    }

    /// The same samples as moments around `t`, for models that move Gaussians to each. When `log_tau` is tracked, they
    /// have a [`shift`](Instants::shift), and the exposure is learned through where the Gaussians are; exact, because
    /// the derivative of a position by time is its velocity. Reads `tau` back from the device.
    pub fn instants(&self, t: f64, samples: Samples, count: usize, share: f64) -> Instants {
        let change = self.log_tau.is_tracked().then(|| self.tau() - self.tau().detach());
        let shift = change.map(|change| Shift { change, rates: samples.shared(count, share) });
        Instants { shift, ..samples.instants(t, self.tau_on_host() * share, count) }
    }
}
