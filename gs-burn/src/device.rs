//! Devices by name, for command lines and configuration files.
//!
//! ```
//! use gs_burn::device;
//!
//! let device = device::select("auto")?.autodiff();
//! assert!(device::select("flax").is_err());
//! # Ok::<(), gs_burn::device::DeviceError>(())
//! ```

#[cfg(feature = "cube")]
mod adapters;
mod auto;
#[cfg(any(feature = "cube", test))]
mod choice;
mod several;
#[cfg(feature = "vulkan")]
mod spirv;

#[cfg(feature = "cube")]
pub(crate) use adapters::class_of_cube;
#[cfg(feature = "cube")]
pub(crate) use choice::AdapterClass;
pub use several::{beside, is_cuda};

use std::fmt;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::str::FromStr;
use std::sync::{Mutex, PoisonError};

use burn::tensor::{Device, Tensor};

/// A backend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceKind {
    /// The best GPU of this build that can train, else Flex, else NdArray. Cards go before GPUs in the processor, then
    /// CUDA before Metal, Vulkan and wgpu. A software adapter is never taken, since it is slower than the CPU backends.
    Auto,
    /// CPU, Burn's Flex.
    Flex,
    /// CPU, Burn's NdArray.
    NdArray,
    /// GPU, on any graphics interface of the platform.
    Wgpu,
    /// GPU through Vulkan.
    Vulkan,
    /// GPU through Metal.
    Metal,
    /// NVIDIA GPU through CUDA.
    Cuda,
}

use DeviceKind::{Auto, Cuda, Flex, Metal, NdArray, Vulkan, Wgpu};

/// All kinds, those of GPUs in the order in which [`DeviceKind::Auto`] prefers them.
const KINDS: [DeviceKind; 7] = [Auto, Cuda, Metal, Vulkan, Wgpu, Flex, NdArray];

/// All backends that a build can have, those on the CPU first.
pub const BACKENDS: [DeviceKind; 6] = [Flex, NdArray, Wgpu, Vulkan, Metal, Cuda];

/// A kind of device and, if there are several, its index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeviceChoice {
    /// The backend.
    pub kind: DeviceKind,
    /// Index in the list of devices of this kind, from 0; `None` is the platform's default.
    pub index: Option<usize>,
}

/// The reason why there is no such device.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// Not a name of the form `kind[:index]`.
    #[error(
        "unknown device `{name}`: expected auto, flex, ndarray, wgpu, vulkan, metal or cuda, for a GPU optionally with \
         an index, as in cuda:1"
    )]
    Unknown {
        /// The name as given.
        name: String,
    },
    /// The kind has no index.
    #[error("device `{kind}` takes no index")]
    NoIndex {
        /// The kind asked for.
        kind: DeviceKind,
    },
    /// This build lacks the backend.
    #[error("device `{kind}` is not part of this build: add `--features {kind}` to the cargo command")]
    NotBuilt {
        /// The kind asked for, also the name of the feature.
        kind: DeviceKind,
    },
    /// There are fewer devices.
    #[error("device `{kind}:{index}` does not exist: found {count} {kind} device(s)")]
    NoSuchIndex {
        /// The kind asked for.
        kind: DeviceKind,
        /// The index asked for.
        index: usize,
        /// How many devices there are.
        count: usize,
    },
    /// Several devices of a kind that is not named.
    #[error("{count} devices: expected the name of their kind, as in `--device cuda`, found auto")]
    SeveralOfAuto {
        /// The number asked for.
        count: usize,
    },
    /// The device does not come up or does not compute.
    #[error("device `{choice}` does not work here: {reason}")]
    Unavailable {
        /// The device as given.
        choice: DeviceChoice,
        /// The message of the driver or of Burn.
        reason: String,
    },
}

/// A device, and for `auto` why it was taken.
#[derive(Clone, Debug)]
pub struct Selected {
    /// The device, without gradient tracking.
    pub device: Device,
    /// The choice of `auto` and the adapters that it passed over, as a sentence without its full stop; `None` where
    /// there was nothing to choose from: for every other name, and in a build for the CPU alone.
    pub why: Option<String>,
}

/// Finds the device called `name`: `auto`, `flex`, `ndarray`, `wgpu`, `vulkan`, `metal` or `cuda`, for a GPU optionally
/// with an index (`cuda:1`). Call [`Device::autodiff`] on it to record gradients.
///
/// # Errors
/// When the name is unknown, its backend is not part of this build, or the device does not work. Never panics.
pub fn select(name: &str) -> Result<Device, DeviceError> {
    Ok(select_explained(name)?.device)
}

/// [`select`], with the reason for what `auto` took.
///
/// # Errors
/// As [`select`].
pub fn select_explained(name: &str) -> Result<Selected, DeviceError> {
    match name.parse::<DeviceChoice>()? {
        DeviceChoice { kind: Auto, .. } => auto::open_best(),
        choice => Ok(Selected { device: choice.open()?, why: None }),
    }
}

impl FromStr for DeviceChoice {
    type Err = DeviceError;

    fn from_str(name: &str) -> Result<Self, DeviceError> {
        let unknown = || DeviceError::Unknown { name: name.to_owned() };
        let (kind, index) = match name.split_once(':') {
            Some((kind, index)) => (kind, Some(index.parse().map_err(|_| unknown())?)),
            None => (name, None),
        };
        let kind = KINDS.into_iter().find(|known| known.name().eq_ignore_ascii_case(kind)).ok_or_else(unknown)?;
        if index.is_some() && (kind == Auto || kind.is_cpu()) {
            return Err(DeviceError::NoIndex { kind });
        }
        Ok(Self { kind, index })
    }
}

impl fmt::Display for DeviceChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.index {
            Some(index) => write!(f, "{}:{index}", self.kind),
            None => write!(f, "{}", self.kind),
        }
    }
}

impl fmt::Display for DeviceKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl DeviceChoice {
    /// Opens the device and checks that it computes.
    ///
    /// # Errors
    /// When its backend is not part of this build, or the device does not work. Never panics.
    pub fn open(self) -> Result<Device, DeviceError> {
        if self.kind == Auto {
            return Ok(auto::open_best()?.device);
        }
        if !self.kind.is_built() {
            return Err(DeviceError::NotBuilt { kind: self.kind });
        }
        let unavailable = |reason| DeviceError::Unavailable { choice: self, reason };
        let listed = || quietly(|| self.kind.list()).map_err(unavailable);
        let device = match self.index {
            // Without the driver CUDA would panic on a thread of its own, and this thread would only see that it hangs
            // up.
            None if self.kind == Cuda && listed()?.is_empty() => {
                return Err(unavailable("found no GPU of NVIDIA's with its driver".to_owned()));
            }
            None => self.kind.default_device(),
            Some(index) => {
                let devices = listed()?;
                let count = devices.len();
                let missing = DeviceError::NoSuchIndex { kind: self.kind, index, count };
                devices.into_iter().nth(index).ok_or(missing)?
            }
        };
        if let Some(reason) = refusal(&device) {
            return Err(unavailable(reason));
        }
        probe(&device).map_err(unavailable)?;
        Ok(device)
    }
}

/// Why a driver must not be given this build's kernels.
#[cfg(feature = "vulkan")]
fn refusal(device: &Device) -> Option<String> {
    quietly(|| spirv::refusal(device)).unwrap_or_else(Some)
}

/// Only kernels in SPIR-V are known to crash a driver.
#[cfg(not(feature = "vulkan"))]
fn refusal(_: &Device) -> Option<String> {
    None
}

impl DeviceKind {
    /// Its name on the command line, which is also that of its feature.
    pub fn name(self) -> &'static str {
        match self {
            Auto => "auto",
            Flex => "flex",
            NdArray => "ndarray",
            Wgpu => "wgpu",
            Vulkan => "vulkan",
            Metal => "metal",
            Cuda => "cuda",
        }
    }

    /// Whether it computes on the CPU.
    pub fn is_cpu(self) -> bool {
        matches!(self, Flex | NdArray)
    }

    /// Whether the backend is part of this build.
    pub fn is_built(self) -> bool {
        match self {
            Auto => false,
            Flex => cfg!(feature = "flex"),
            NdArray => cfg!(feature = "ndarray"),
            Wgpu => cfg!(feature = "wgpu"),
            Vulkan => cfg!(feature = "vulkan"),
            Metal => cfg!(feature = "metal"),
            Cuda => cfg!(feature = "cuda"),
        }
    }

    /// The platform's default among the devices of a kind that is built. Nothing is opened yet.
    fn default_device(self) -> Device {
        match self {
            #[cfg(feature = "flex")]
            Flex => Device::flex(),
            #[cfg(feature = "ndarray")]
            NdArray => Device::ndarray(),
            #[cfg(feature = "wgpu")]
            Wgpu => Device::wgpu(Default::default()),
            #[cfg(feature = "vulkan")]
            Vulkan => Device::vulkan(Default::default()),
            #[cfg(feature = "metal")]
            Metal => Device::metal(Default::default()),
            #[cfg(feature = "cuda")]
            Cuda => Device::cuda(0_usize),
            other => unreachable!("{other} is not built"),
        }
    }

    /// All devices of a GPU kind that is built.
    fn list(self) -> Vec<Device> {
        #[allow(unused_imports)] // A build for the CPU alone lists nothing.
        use burn::tensor::DeviceType;
        match self {
            #[cfg(feature = "wgpu")]
            Wgpu => Device::enumerate(DeviceType::Wgpu).into_vec(),
            #[cfg(feature = "vulkan")]
            Vulkan => Device::enumerate(DeviceType::Vulkan).into_vec(),
            #[cfg(feature = "metal")]
            Metal => Device::enumerate(DeviceType::Metal).into_vec(),
            #[cfg(feature = "cuda")]
            Cuda => Device::enumerate(DeviceType::Cuda).into_vec(),
            other => unreachable!("{other} has no index or is not built"),
        }
    }
}

/// Whether `device` is one of CubeCL's, which are GPUs.
#[cfg(feature = "cube")]
pub fn is_gpu(device: &Device) -> bool {
    device.identity().is_some()
}

/// A build without CubeCL has no GPU.
#[cfg(not(feature = "cube"))]
pub fn is_gpu(_: &Device) -> bool {
    false
}

/// Computes something small and reads it back.
///
/// On CUDA the exponential needs a file of the toolkit, unlike a sum.
fn probe(device: &Device) -> Result<(), String> {
    let powers = quietly(|| Tensor::<1>::zeros([4], device).exp().try_into_data())?;
    let powers = powers.map_err(|error| innermost(&error.to_string()))?;
    match powers.try_to_vec::<f32>() {
        Ok(ones) if ones == [1.0; 4] => Ok(()),
        wrong => Err(format!("it computes exp(0) = {wrong:?}")),
    }
}

/// The last cause in a device's message, which the user can act on; Burn returns the chain as one text.
fn innermost(message: &str) -> String {
    let cause = message.rsplit("Caused by:").next().unwrap_or(message);
    let cause = cause.split("Backtrace:").next().unwrap_or(cause);
    cause.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Runs `task`; a panic becomes its message.
///
/// Opening a GPU is lazy in Burn and panics without an adapter or a driver; no call returns an error instead. The panic
/// hook is silenced meanwhile, because it would print a backtrace for an ordinary result. The hook belongs to the whole
/// process, so open devices before starting threads.
fn quietly<T>(task: impl FnOnce() -> T) -> Result<T, String> {
    // Two at once would each restore the hook they found, and the second would find the silent one of the first.
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _guard = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| {}));
    let result = catch_unwind(AssertUnwindSafe(task));
    std::panic::set_hook(hook);
    result.map_err(|panic| match (panic.downcast_ref::<String>(), panic.downcast_ref::<&str>()) {
        (Some(message), _) => message.clone(),
        (_, Some(message)) => (*message).to_owned(),
        _ => "it fails without a message".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_choices_correspond() {
        for name in ["auto", "flex", "ndarray", "wgpu", "vulkan:3", "metal", "cuda:1"] {
            assert_eq!(name.parse::<DeviceChoice>().unwrap().to_string(), name);
        }
        assert_eq!("CUDA:0".parse(), Ok(DeviceChoice { kind: Cuda, index: Some(0) }));
    }

    #[test]
    fn the_last_cause_is_what_is_said() {
        let message =
            "An error happened\nCaused by:\n  A launch failed\nCaused by:\n  a file is\n  missing\nBacktrace:\nNone";
        assert_eq!(innermost(message), "a file is missing");
        assert_eq!(innermost("no chain"), "no chain");
    }

    #[test]
    fn bad_names_are_errors() {
        for name in ["", "gpu", "cuda:", "cuda:-1", "cuda:x", "cuda:1:2", "cuda:99999999999999999999", ":"] {
            assert_eq!(name.parse::<DeviceChoice>(), Err(DeviceError::Unknown { name: name.to_owned() }));
        }
        assert_eq!("flex:0".parse::<DeviceChoice>(), Err(DeviceError::NoIndex { kind: Flex }));
    }

    #[test]
    fn what_is_not_built_names_its_feature() {
        for kind in KINDS.into_iter().filter(|kind| *kind != Auto && !kind.is_built()) {
            let error = select(kind.name()).unwrap_err();
            assert!(error.to_string().contains(&format!("--features {kind}")), "{error}");
        }
    }

    #[test]
    fn every_built_device_opens_or_says_why() {
        let auto = select_explained("auto").unwrap();
        assert_eq!(auto.why.is_some(), cfg!(feature = "cube"), "{:?}", auto.why);
        assert!(auto.why.is_none_or(|why| why.starts_with("auto took ")));
        for kind in KINDS.into_iter().filter(|kind| kind.is_built()) {
            match select(kind.name()) {
                Ok(_) => {}
                Err(DeviceError::Unavailable { .. }) => assert!(!kind.is_cpu()),
                Err(other) => panic!("{other}"),
            }
            if !kind.is_cpu() {
                let error = select(&format!("{kind}:4000")).unwrap_err();
                assert!(matches!(error, DeviceError::NoSuchIndex { .. } | DeviceError::Unavailable { .. }), "{error}");
            }
        }
    }

    #[test]
    fn a_panic_becomes_its_message() {
        assert_eq!(quietly(|| panic!("no {}", "adapter")).map(|(): ()| 0), Err("no adapter".to_owned()));
        assert_eq!(quietly(|| 3), Ok(3));
    }
}
