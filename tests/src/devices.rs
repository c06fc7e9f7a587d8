//! Where the tests run.

use std::sync::OnceLock;

use burn::tensor::{DType, Device, Tensor, TensorData};
use gs_burn::device::{BACKENDS, DeviceChoice, DeviceKind, select};

#[cfg(not(any(feature = "flex", feature = "ndarray")))]
compile_error!("the tests judge by an f64 reference on the CPU: switch on the feature `flex` or `ndarray`");

/// A device and the float a test uses on it.
#[derive(Clone, Debug)]
pub struct Place {
    /// As in `--device`, with the float type: for messages.
    pub name: String,
    /// The device, without gradient tracking.
    pub device: Device,
    /// `F32` or `F64`.
    pub dtype: DType,
}

impl Place {
    /// With the feature on, the device must be there: a test that passes because it did not run is worse than one that
    /// fails.
    fn new(kind: DeviceKind, dtype: DType) -> Self {
        let device = select(kind.name());
        let device = device.unwrap_or_else(|error| panic!("the build has this device, so it must work: {error}"));
        Self { name: format!("{kind} {dtype:?}"), device, dtype }
    }

    /// Whether it computes in `f64`.
    pub fn is_double(&self) -> bool {
        self.dtype == DType::F64
    }

    /// `values` as a tensor of this place, without gradient tracking.
    pub fn tensor<const D: usize>(&self, values: &[f64], shape: [usize; D]) -> Tensor<D> {
        Tensor::from_data(TensorData::new(values.to_vec(), shape), (&self.device, self.dtype))
    }

    /// `values` as a tensor that requires a gradient.
    pub fn leaf<const D: usize>(&self, values: &[f64], shape: [usize; D]) -> Tensor<D> {
        self.tensor(values, shape).autodiff().require_grad()
    }
}

/// Names a part of a build's backends, as in `flex,vulkan`; without it tests run on all of them.
const TEST_BACKENDS: &str = "GSBURN_TEST_BACKENDS";

/// The backends of this build, or those that [`TEST_BACKENDS`] names, those on the CPU first. A misspelt name fails
/// here, one that is not built where it is opened.
fn built() -> impl Iterator<Item = DeviceKind> {
    let kind =
        |name: &str| name.parse::<DeviceChoice>().unwrap_or_else(|error| panic!("{TEST_BACKENDS}: {error}")).kind;
    let chosen: Option<Vec<_>> = std::env::var(TEST_BACKENDS).ok().map(|names| names.split(',').map(kind).collect());
    BACKENDS.into_iter().filter(move |kind| chosen.as_ref().map_or(kind.is_built(), |chosen| chosen.contains(kind)))
}

/// Every device of this build in `f32`.
pub fn singles() -> &'static [Place] {
    static PLACES: OnceLock<Vec<Place>> = OnceLock::new();
    PLACES.get_or_init(|| built().map(|kind| Place::new(kind, DType::F32)).collect())
}

/// Every CPU device of this build in `f64`.
pub fn doubles() -> &'static [Place] {
    static PLACES: OnceLock<Vec<Place>> = OnceLock::new();
    PLACES.get_or_init(|| built().filter(|kind| kind.is_cpu()).map(|kind| Place::new(kind, DType::F64)).collect())
}

/// Every device in every float type it has.
pub fn everywhere() -> impl Iterator<Item = &'static Place> {
    doubles().iter().chain(singles())
}

/// Every device in every float type, each with the bound for that type.
pub fn bounded(double: f64, single: f64) -> impl Iterator<Item = (&'static Place, f64)> {
    everywhere().map(move |place| (place, if place.is_double() { double } else { single }))
}

/// Where reference bodies run.
pub fn reference() -> &'static Place {
    &doubles()[0]
}
